"""Reads recordings of scenarios/kill-at-waypoint.toml and examples/agents/lanes.toml with independent programs.

recordings.py FOLDER
"""

import json
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

import jsonschema
from mcap.reader import make_reader

folder = pathlib.Path(sys.argv[1])


def messages(name):
    """The messages of a recording by schema, each with its time. All are valid."""
    validators = {}
    found = {}
    with open(folder / name, "rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            if schema.id not in validators:
                text = json.loads(schema.data)
                jsonschema.Draft202012Validator.check_schema(text)
                validators[schema.id] = jsonschema.Draft202012Validator(text)
            value = json.loads(message.data)
            validators[schema.id].validate(value)
            found.setdefault(schema.name, []).append((message.log_time, value))
    return found


seen = messages("killed.mcap")
for name in ["foxglove.SceneUpdate", "foxglove.Log", "foxglove.LocationFix", "muster.Drone", "muster.Swarm"]:
    assert seen.get(name), f"{name} is missing"
deaths = [value["message"] for _, value in seen["foxglove.Log"] if value["name"] == "death"]
assert deaths == ["drone 3, a leader, is dead: its computer failed, its flight controller lands it"], deaths
print("mcap:", ", ".join(f"{len(values)} {name}" for name, values in sorted(seen.items())))
finds = [value["value"] for _, value in messages("lanes.mcap")["muster.Value"] if value["name"] == "finds"]
assert max(finds) == 3, finds
print("values:", len(finds))

GX = "{http://www.google.com/kml/ext/2.2}"
KML = "{http://www.opengis.net/kml/2.2}"
tracks = ElementTree.parse(folder / "killed.kml").getroot().findall(f".//{GX}Track")
assert len(tracks) == 7, len(tracks)
for track in tracks:
    assert len(track.findall(f"{KML}when")) == len(track.findall(f"{GX}coord")) > 10
print("kml:", len(tracks), "tracks")

features = json.loads((folder / "killed.geojson").read_text())["features"]
kinds = [it["geometry"]["type"] for it in features]
assert kinds.count("LineString") == 7, kinds
print("geojson:", len(features), "features")

svg = ElementTree.parse(folder / "killed.svg").getroot()
animated = svg.findall(".//{http://www.w3.org/2000/svg}animateTransform")
assert len(animated) == 7, len(animated)
print("animation:", len(animated), "drones")
