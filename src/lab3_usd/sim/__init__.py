"""A dry run: executes the graphs of a composed stage, drives its robot, judges what is published.

It knows Isaac Sim's nodes, from their published source, and nothing of the rules: what a graph
should look like is not in here.
"""
