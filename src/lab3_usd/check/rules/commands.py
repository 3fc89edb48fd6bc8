"""Rules about who commands the robot: the lab's drive graph, and nobody beside it."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.commanders import is_doubtful, second_commanders
from lab3_usd.check.finding import Problem
from lab3_usd.check.registry import rule
from lab3_usd.check.running import doubt, live_nodes
from lab3_usd.check.say import title_of
from lab3_usd.check.subject import StageSubject
from lab3_usd.check.topic_view import played_roles
from lab3_usd.check.topics import endpoints


@rule("N12", "wheels-commanded-twice", scope="stage")
def wheels_commanded_twice(subject: StageSubject) -> Iterator[Problem]:
    """A second node commands the wheels of the robot.

    Why: it writes the wheels' velocities with every frame, as the lab's own controller does, and
    the last one wins: the robot stands still or drives otherwise than /cmd_vel says.

    Fix: delete the graph of that node. Isaac Sim's menu for a differential controller makes one.

    Example: `/Graph/differential_controller/ArticulationController`, made by Tools > Robotics >
    OmniGraph Controllers > Differential Controller.
    """
    stage, lab = subject.stage, subject.lab
    live = live_nodes(stage, lab)
    for node, own in second_commanders(stage, lab, subject.roles):
        doubtful = "warning" if is_doubtful(node, live) else doubt(stage, lab, node.path, own)
        yield Problem(
            node.path,
            f"{title_of(node)} commands the wheels as well, which only {own} may do",
            expected="one controller",
            actual=node.type_name,
            handout=lab.scene["robot"]["wheels"]["handout"],
            related=(own,),
            severity=doubtful,
        )


@rule("Q06", "topic-of-commands-published", scope="stage", severity="warning")
def topic_of_commands_published(subject: StageSubject) -> Iterator[Problem]:
    """The stage publishes a topic that the lab takes from outside.

    Why: teleop and Nav2 send /cmd_vel. A publisher in the stage sends its own commands between
    theirs, and the robot follows both in turn.

    Fix: delete the publisher, or give it another topic.

    Example: a ROS2 Publisher sends geometry_msgs/msg/Twist on `/cmd_vel`.
    """
    played = played_roles(subject)
    found = endpoints(subject.stage, subject.lab)
    taken = {
        each.topic: each.node.path
        for each in found
        if each.topic and each.direction == "subscribes" and each.node.path in played
    }
    for each in found:
        if each.runs and each.direction == "publishes" and each.topic in taken:
            yield Problem(
                each.node.path,
                f"publishes {each.topic}, which {taken[each.topic]} takes from outside the stage",
                property=each.port,
                actual=each.topic,
                related=(taken[each.topic],),
            )
