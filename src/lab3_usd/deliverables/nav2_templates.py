"""The files of localization and navigation, and how templates of text files are filled."""

from __future__ import annotations

from pathlib import Path

from msgspec import structs

from lab3_usd.errors import UsageError
from lab3_usd.spec.lab import Lab
from lab3_usd.spec.ros import RosSpec

_FOLDER = Path(__file__).resolve().parent / "templates"


def fill_template(template: Path, **values: object) -> str:
    """Return a template with its values; a value that is missing is an error."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(template.parent, encoding="utf-8"),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701 - YAML, Python and shell, not HTML
    )
    return environment.get_template(template.name).render(**values)


LAUNCH_FILE = "lab3_launch.py"
PARAMS_FILE = "nav2_params.yaml"
RVIZ_FILE = "lab3_navigation.rviz"
LIDAR_RVIZ_FILE = "lab3_lidar.rviz"
_MOST_SCALE = 100.0  # pixels per metre: the lidar's surroundings fill the window
_MAP_SCALE = 70.0


def nav2_files(lab: Lab, ros: RosSpec) -> dict[str, str]:
    """Return the files by name, for the distribution that `ros.yaml` names.

    Nothing of it has run in ROS. Velocity commands are plain Twist messages, as Humble sends them.
    """
    values = _values(lab, ros)
    navigation = {
        **values,
        "file": RVIZ_FILE,
        "title": f"localization and navigation of {lab.title}",
        "navigation": True,
        "fixed_frame": values["map_frame"],
        "scale": _MAP_SCALE,
    }
    lidar = {
        **values,
        "file": LIDAR_RVIZ_FILE,
        "title": f"the lidar alone of {lab.title}",
        "navigation": False,
        "fixed_frame": values["lidar_frame"],
        "scale": _MOST_SCALE,
    }
    return {
        LAUNCH_FILE: fill_template(_FOLDER / "lab3_launch.py.j2", **values),
        PARAMS_FILE: fill_template(_FOLDER / "nav2_params.yaml.j2", **values),
        RVIZ_FILE: fill_template(_FOLDER / "lab3.rviz.j2", **navigation),
        LIDAR_RVIZ_FILE: fill_template(_FOLDER / "lab3.rviz.j2", **lidar),
    }


def _values(lab: Lab, ros: RosSpec) -> dict[str, object]:
    """Everything that the templates name: what the lab says of navigation, frames, files."""
    navigation, goal, facts = ros.navigation, ros.goal, lab.scene.map
    localization = lab.frames.localization
    if navigation is None or goal is None or facts is None or localization is None:
        parts = {"navigation": navigation, "goal": goal, "map": facts, "localization": localization}
        lacking = ", ".join(f"no {name}" for name, part in parts.items() if part is None)
        raise UsageError(f"{lab.title} has {lacking}, and so no files for Nav2")
    map_frame, odom_frame = localization.edge
    scan = lab.topics.get(navigation.scan_topic)
    scan_fields = scan.fields or {} if scan is not None else {}
    return {
        **structs.asdict(navigation),
        "lab": lab.title,
        "distribution": ros.system.distribution,
        "folder": ros.system.folder,
        "launch_file": LAUNCH_FILE,
        "params_file": PARAMS_FILE,
        "rviz_file": RVIZ_FILE,
        "map_yaml": "/".join(filter(None, (lab.submission.folders.maps, facts.yaml))),
        "map_frame": map_frame,
        "odom_frame": odom_frame,
        "base_frame": lab.frame_of(lab.scene.robot.base),
        "lidar_frame": scan_fields.get("header.frame_id") or localization.chain[-1],
        "robot_topic": goal.robot,
        "goal_topic": goal.pose,
        "resolution": facts.resolution,
    }
