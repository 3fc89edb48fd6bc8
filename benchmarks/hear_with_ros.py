"""Lets ROS 2 itself hear a live dry run, drive its robots and look up TF.

Usage: python3 benchmarks/hear_with_ros.py [--lab3 COMMAND] [--seconds S] STAGE...

Run it with the Python of ROS 2 (`source /opt/ros/humble/setup.bash` first); it needs nothing of
this program but the command. Each stage is played by `lab3 sim --live`. Every topic must be heard,
each robot must move by the commands on its topic, and tf2 must find the child of each odometry in
its frame. What ROS 2 does not have here, such as the package of a message, is named. Without rclpy
it says `skipped`. The exit status is 1 if something is not heard, does not move or is not found.
"""

from __future__ import annotations

import argparse
import math
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

LISTENS = re.compile(r"listens to (\S+) \((\S+)\) in domain (\d+)")
SENT = re.compile(r"(/\S+)\s+(\S+/msg/\S+)\s+(\d+) sent")
TWIST, STEERING = "geometry_msgs/msg/Twist", "ackermann_msgs/msg/AckermannDriveStamped"
ODOMETRY, JOINTS = "nav_msgs/msg/Odometry", "sensor_msgs/msg/JointState"
STATIC = "/tf_static"
MOVED, TURNED = 0.05, 0.02  # metres, and radians or metres of a joint, that count as motion
OFTEN = 0.1  # seconds between commands


def message_class(kind: str) -> Any | None:
    """Return the class of a message type, None where its package is not here."""
    package, _, name = kind.split("/")
    try:
        return getattr(import_module(f"{package}.msg"), name, None)
    except ImportError:
        return None


class Listener:
    """A node of ROS 2 in one domain: what it hears, and what it sends."""

    def __init__(self, rclpy: Any, domain: int) -> None:
        self.qos = import_module("rclpy.qos")
        self.context = rclpy.context.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("hear_with_ros", context=self.context)
        self.executor = rclpy.executors.SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard: dict[str, list[Any]] = {}  # the first and the last message of each topic
        self.counts: dict[str, int] = {}
        self.types: dict[str, str] = {}
        self.senders: dict[str, tuple[str, Any]] = {}
        self.buffer = None
        try:
            tf2 = import_module("tf2_ros")
        except ImportError:
            return
        self.buffer = tf2.Buffer()
        self.listener = tf2.TransformListener(self.buffer, self.node)

    def subscribe(self) -> None:
        """Listen to every topic that somebody publishes, with the QoS that is offered."""
        for topic, kinds in self.node.get_topic_names_and_types():
            offers = self.node.get_publishers_info_by_topic(topic)
            offers = [offer for offer in offers if offer.node_name != self.node.get_name()]
            if topic in self.types or not offers:
                continue
            made = message_class(kinds[0])
            if made is None:
                continue
            profile = self.qos.QoSProfile(depth=100)
            profile.reliability = offers[0].qos_profile.reliability
            profile.durability = offers[0].qos_profile.durability
            self.types[topic] = kinds[0]
            self.node.create_subscription(made, topic, self._keeper(topic), profile)

    def _keeper(self, topic: str) -> Any:
        def keep(message: Any) -> None:
            self.counts[topic] = self.counts.get(topic, 0) + 1
            self.heard[topic] = [*self.heard.get(topic, ())[:1], message]

        return keep

    def command(self, topic: str, kind: str) -> None:
        """Send a command: ahead, along an arc, or each known joint a little further."""
        made = message_class(kind)
        if made is None:
            return
        if topic not in self.senders:
            self.senders[topic] = (kind, self.node.create_publisher(made, topic, 10))
        message = made()
        if kind == TWIST:
            message.linear.x = 0.15
        elif kind == STEERING:
            message.drive.speed, message.drive.steering_angle = 0.3, 0.1
        else:
            states = [messages[0] for name, messages in self.heard.items() if self.is_joints(name)]
            if not states:
                return
            message.name = [name for state in states for name in state.name]
            message.position = [place + 0.1 for state in states for place in state.position]
        self.senders[topic][1].publish(message)

    def is_joints(self, topic: str) -> bool:
        """Whether a topic has the states of joints, and no commands of ours."""
        return self.types.get(topic) == JOINTS and topic not in self.senders

    def spin(self, seconds: float) -> None:
        """Take what comes for a while."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self.executor.spin_once(timeout_sec=0.01)

    def moved(self) -> Iterator[tuple[str, float, float]]:
        """Yield how far each odometry and each topic of joint states went, and what counts."""
        for topic, messages in self.heard.items():
            first, last = messages[0], messages[-1]
            if self.types[topic] == ODOMETRY:
                here, there = first.pose.pose.position, last.pose.pose.position
                yield topic, math.hypot(there.x - here.x, there.y - here.y), MOVED
            elif self.is_joints(topic):
                pairs = zip(first.position, last.position)  # noqa: B905 - Humble's is Python 3.10
                yield topic, max((abs(b - a) for a, b in pairs), default=0.0), TURNED

    def lookups(self) -> Iterator[tuple[str, str, bool]]:
        """Yield frame and child of each odometry, and whether tf2 finds one from the other."""
        newest = import_module("rclpy.time").Time()
        for topic, messages in self.heard.items():
            if self.types[topic] == ODOMETRY and self.buffer is not None:
                frame, child = messages[-1].header.frame_id, messages[-1].child_frame_id
                yield frame, child, self.buffer.can_transform(frame, child, newest)

    def close(self) -> None:
        """Leave the domain."""
        self.node.destroy_node()
        self.context.try_shutdown()


def hear(rclpy: Any, lab3: str, stage: str, seconds: float) -> bool:
    """Play one stage, print what ROS 2 heard of it, and return whether all is right."""
    print(f"{stage}:", flush=True)
    command = [lab3, "sim", stage, "--live", "--seconds", str(seconds + 5.0)]
    listeners: dict[int, Listener] = {}
    subscribers: list[tuple[str, str, int]] = []
    lines: list[str] = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as played:
        assert played.stdout is not None  # noqa: S101
        reader = threading.Thread(target=lines.extend, args=(played.stdout,))
        reader.start()
        started = time.monotonic()
        while time.monotonic() - started < seconds and played.poll() is None:
            subscribers = [
                (found[1], found[2], int(found[3])) for found in map(LISTENS.match, lines) if found
            ]
            for domain in {0, *(domain for *_, domain in subscribers)} - listeners.keys():
                listeners[domain] = Listener(rclpy, domain)
            for domain, listener in listeners.items():
                listener.subscribe()
                for topic, kind, where in subscribers:
                    if where == domain:
                        listener.command(topic, kind)
                listener.spin(OFTEN / len(listeners))
        ended = played.poll()  # by itself, before its time
        played.terminate()
        reader.join()
    is_whole = _line(ended is None, "the dry run lasted" if ended is None else f"it ended: {ended}")
    return all([is_whole, *_results(listeners, subscribers)])


def _results(
    listeners: dict[int, Listener], subscribers: list[tuple[str, str, int]]
) -> Iterator[bool]:
    """Print a line for each topic, motion and lookup, and yield whether it is right."""
    for domain, listener in sorted(listeners.items()):
        for topic, kind in sorted(listener.types.items()):
            count = listener.counts.get(topic, 0)
            yield _line(count > 0, f"domain {domain}: {topic} ({kind}): {count} messages")
        for topic, kind, where in subscribers:
            if where == domain and message_class(kind) is None:
                yield _line(None, f"domain {domain}: {topic}: {kind} is not in this ROS 2")
        is_driven = any(where == domain for *_, where in subscribers)
        for topic, far, least in listener.moved() if is_driven else ():
            yield _line(far >= least, f"domain {domain}: {topic} moved by {far:.3f}")
        if listener.buffer is None:
            yield _line(None, f"domain {domain}: TF is not looked up: tf2_ros is not here")
        for frame, child, is_found in listener.lookups():
            yield _line(is_found, f"domain {domain}: tf2 looks up {frame} -> {child}")
        listener.close()


def _line(is_right: bool | None, text: str) -> bool:  # noqa: FBT001
    print(f"  {'skipped' if is_right is None else 'ok' if is_right else 'bad':<8}{text}")
    return is_right is not False


def main() -> int:
    """Hear each stage, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    beside = Path(__file__).resolve().parents[1] / ".venv" / "bin" / "lab3"
    parser.add_argument("stages", nargs="+", metavar="STAGE")
    parser.add_argument("--lab3", default=str(beside) if beside.exists() else "lab3")
    parser.add_argument("--seconds", type=float, default=10.0)
    given = parser.parse_args()
    try:
        rclpy = import_module("rclpy")
        import_module("rclpy.executors")
    except ImportError:
        print("skipped: ROS 2 is not here (no module rclpy); source its setup.bash first")
        return 0
    results = [hear(rclpy, given.lab3, stage, given.seconds) for stage in given.stages]
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
