"""Writes `graphs/isaac/sensor_schemas.json`: the attributes of NVIDIA's sensor schemas.

Run `python docs/make_sensor_schemas.py SCHEMAS`. SCHEMAS is a JSON file of what the generated
schema of `omni.sensors.nv.common` has: names, types, defaults and tokens by class.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

FILE = Path(__file__).resolve().parents[1] / "graphs" / "isaac" / "sensor_schemas.json"
RELEASE = "6.0.0.1"
ABOUT = (
    "The schemas of RTX sensors: facts read off the generated schema of omni.sensors.nv.common "
    "3.0.0 (wheel isaacsim-extscache-kit-sdk 6.0.0.1; 6.2.0.0 has the same), by "
    "docs/make_sensor_schemas.py: change that, not this. A * is the name of an instance. Of a long "
    "default, its length and its lowest and highest value."
)
INSTANCE = "__INSTANCE_NAME__"


def schemas(classes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the applied schemas by name: what each brings, and its attributes."""
    return {
        name: {
            "brings": entry.get("builtInApiSchemas", []),
            "attributes": {
                attribute.replace(INSTANCE, "*"): _attribute(said)
                for attribute, said in sorted(entry["attributes"].items())
            },
        }
        for name, entry in sorted(classes.items())
        if entry["kind"].endswith("ApplyAPI")
    }


def _attribute(said: Mapping[str, Any]) -> dict[str, Any]:
    default = said.get("default")
    if isinstance(default, dict):
        low, high = default["first"][0], default["last"]
        default = {"length": default["length"], "low": low, "high": high}
    found = {"type": said["type"], "default": default, "tokens": said.get("allowedTokens")}
    return {key: value for key, value in found.items() if value is not None}


def text(found: Mapping[str, Any]) -> str:
    """Return the text of the file, an attribute in a line."""
    parts = []
    for name, entry in found.items():
        lines = (
            f"  {json.dumps(key)}: {json.dumps(said)}" for key, said in entry["attributes"].items()
        )
        brings = json.dumps(entry["brings"])
        inside = ",\n".join(lines)
        parts.append(f'{json.dumps(name)}: {{"brings": {brings}, "attributes": {{\n{inside}\n}}}}')
    joined = ",\n".join(parts)
    return f'{{\n"about": {json.dumps(ABOUT)},\n"schemas": {{\n{joined}\n}}\n}}\n'


def main() -> None:
    """Write the file."""
    said = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    FILE.write_text(text(schemas(said["omniSensor"][RELEASE])), encoding="utf-8")


if __name__ == "__main__":
    main()
