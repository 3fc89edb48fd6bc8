"""What the handout asks of the lidar and the camera, item by item."""

from __future__ import annotations

from collections.abc import Iterator

from lab3_usd.check.scene_item import SceneItem, pose_items
from lab3_usd.spec.spec import Lab


def _sensor_items(lab: Lab, sensor: str, letter: str) -> Iterator[SceneItem]:
    spec = lab.scene[sensor]
    path, group = spec["path"], spec["path"].rpartition("/")[2]
    rules = tuple(f"{letter}0{number}" for number in (1, 2, 3))
    yield SceneItem(f"{group}/prim", group, f"{path} exists", path, None, spec["handout"], rules)
    is_lidar = sensor == "lidar"
    place = ("L04",) if is_lidar else ("C04",)
    turn = ("L04",) if is_lidar else ("C05",)
    by_kind = {"translate": place, "rotate": turn, "scale": place}
    yield from pose_items(group, path, spec["pose"], by_kind)
    for name, entry in spec["attributes"].items():
        if entry.get("required"):
            title = f"{group}: {name} {entry['value']}"
            values = ("L05",) if is_lidar else ("C06", "C07")
            short = name.rpartition(":")[2]
            yield SceneItem(f"{group}/{short}", group, title, path, name, entry["handout"], values)


def lidar_items(lab: Lab) -> Iterator[SceneItem]:
    """Yield what D3 to D5 ask."""
    yield from _sensor_items(lab, "lidar", "L")
    spec, forbidden = lab.scene["lidar"], lab.scene["forbidden"]["lidar"]
    scan = spec["scan"]
    group = spec["path"].rpartition("/")[2]
    yield SceneItem(
        f"{group}/schema",
        group,
        f"{group} has the lidar's schema and gives a scan",
        spec["path"],
        None,
        spec["handout"],
        ("L06", "L09"),
        (*scan["above_zero"], scan["emitters"], *(low for low, _ in scan["rising"])),
    )
    title, handout = "no second lidar", forbidden["handout"]
    yield SceneItem(
        f"{group}/only", group, title, spec["path"], None, handout, ("L07",), anywhere=True
    )


def camera_items(lab: Lab) -> Iterator[SceneItem]:
    """Yield what E3 to E5 ask."""
    yield from _sensor_items(lab, "camera", "C")
