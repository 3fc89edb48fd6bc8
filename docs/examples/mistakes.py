"""Makes four mistakes that are easily made, in a copy of a correct drive checkpoint.

python docs/examples/mistakes.py tour/Lab3_02_ros_drive.usda mine/Lab3_02_ros_drive.usda
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from pxr import Usd

DRIVE = "/turtlebot3_burger/ROS_Drive"


def make_mistakes(correct: Path, target: Path) -> None:
    """Copy a stage and save the mistakes in the copy."""
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(correct, target)
    stage = Usd.Stage.Open(str(target))
    # The clock never publishes: nothing triggers it.
    stage.GetAttributeAtPath("/World/ROS_Clock/ros2_publish_clock.inputs:execIn").ClearConnections()
    # Left is right: the robot turns the other way.
    stage.GetAttributeAtPath(f"{DRIVE}/constant_left_joint.inputs:value").Set("wheel_right_joint")
    stage.GetAttributeAtPath(f"{DRIVE}/constant_right_joint.inputs:value").Set("wheel_left_joint")
    # What the wheels measure, and not what the handout says.
    stage.GetAttributeAtPath(f"{DRIVE}/differential_controller.inputs:wheelRadius").Set(0.033)
    # A node that looks superfluous where a stage is in metres anyway.
    stage.RemovePrim(f"{DRIVE}/scale_linear_velocity")
    stage.Save()


if __name__ == "__main__":
    make_mistakes(Path(sys.argv[1]), Path(sys.argv[2]))
