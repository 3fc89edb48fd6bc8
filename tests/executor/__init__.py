"""A dry run: executes the graphs of a composed stage, drives its robot, records what is published.

It knows Isaac Sim's nodes and nothing of the lab: what a graph should look like is not in here.
"""
