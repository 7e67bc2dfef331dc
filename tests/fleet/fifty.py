"""Fifty hosts on one machine: how long `muster deploy` takes to ask all of them, and to find nothing to do.
`fifty.py MUSTER [HOSTS]`.

In the place of ssh there is a shell script, HOST below: a host whose files are in a folder. It speaks the protocol of `musterd
slot serve` and keeps what it is told, and has neither services nor drones. So this measures the operator's side and the
protocol, not ssh, hosts or a radio.
"""

import json
import pathlib
import statistics
import subprocess
import sys
import time

STATUS_MAX_S = 3.0
APPLY_MAX_S = 10.0
RUNS = 5


HOST = """#!/bin/sh
folder=$1; shift
case "$*" in
    *"slot serve") ;;
    uname*) echo x86_64; exit ;;
    mktemp*) echo /var/tmp/muster.fifty; exit ;;
    *) cat > /dev/null; exit ;;
esac
facts='EMPTY'
if test -e "$folder/facts"; then
    read -r facts < "$folder/facts"
else
    case $1 in /opt/muster/*) exit 127 ;; esac
fi
echo '{"Hello":{"protocol":1,"version":"0.1.0","processor":"x86_64","is_root":true}}'
while read -r order; do
    case $order in
        '"Look"') printf '%s\\n' "$facts" ;;
        '{"Install"'*) printf '%s\\n' "$order" > "$folder/order"; exec PYTHON --install "$folder" ;;
        *) echo '"Done"' ;;
    esac
done
"""


def install(folder):
    """The rest of a session in which a host gets a slot. It is good as soon as it is tried."""
    incoming = json.loads((folder / "order").read_text())["Install"]
    sys.stdin.buffer.read(sum(it["bytes"] for it in incoming["files"]))
    slot = incoming["facts"]
    reply({"Installed": {"slot": name(slot)}})
    for line in iter(sys.stdin.buffer.readline, b""):
        if json.loads(line) == "Look":
            reply({"Host": facts(slot)})
        else:
            (folder / "facts").write_text(json.dumps({"Host": facts(slot)}) + "\n")
            reply("Done")


def reply(it):
    print(json.dumps(it), flush=True)


def name(slot):
    return f"{slot['version']}-{slot['release'][:8]}-{slot['configuration'][:8]}"


def facts(slot):
    """What a host says that has run this slot for long, and whose drones are well."""
    drone = {
        "health": {"Healthy": {"proven": slot["peers"] if slot else []}},
        "in_flight": False, "version": "0.1.0", "dropped": 0, "restarts": 0,
    }
    return {
        "current": slot, "good": name(slot) if slot else None, "rollback_slot": None, "is_on_trial": False, "good_for_s": 600,
        "failure": None, "drones": {number: drone for number in slot["drones"]} if slot else {}, "free_bytes": 10**9,
    }


def run(*words):
    done = subprocess.run(words, text=True, capture_output=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(words)} ends with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


def prepare(muster, folder, hosts):
    python = f"{sys.executable} -I -S {pathlib.Path(__file__).resolve()}"
    host = folder / "host"
    host.write_text(HOST.replace("EMPTY", json.dumps({"Host": facts(None)})).replace("PYTHON", python))
    host.chmod(0o755)
    numbers = [str(number) for number in range(hosts)]
    run(muster, "keys", "fleet", f"{folder}/keys")
    run(muster, "keys", "drone", f"{folder}/keys", *numbers)
    (folder / "fifty.toml").write_text(
        f'seed = 1\n[formation]\nkind = "linear"\ndrones = {hosts}\nspacing_m = 20\n[mission]\nfile = "hop"\n[radio]\nrange_m = 2000\n'
        '[protocol]\npolicy = "tree"\nparameters = "fast"\n[safety]\navoid = true\n'
    )
    lines = ['group = "239.78.0.1:4700"', 'scenario = "fifty.toml"', 'keys = "keys"', "flight = 1"]
    for number in numbers:
        (folder / f"pi{number}").mkdir()
        words = [str(host), f"{folder}/pi{number}"]
        lines += ["[[hosts]]", f'name = "pi{number}"', f"run = {json.dumps(words)}", f"drones = [{number}]"]
    names = json.dumps([f"pi{number}" for number in numbers])
    lines += ["[[waves]]", f"hosts = {names}", f"at_once = {hosts}", "soak_s = 0"]
    (folder / "fleet.toml").write_text("\n".join(lines) + "\n")
    programs = folder / "programs/x86_64"
    programs.mkdir(parents=True)
    for program in ["muster", "musterd"]:
        (programs / program).write_text("#!/bin/sh\n")
    run(muster, "deploy", "package", "--programs", str(programs.parent), "--keys", f"{folder}/keys", "--out", str(folder))
    return str(next(folder.glob("*.tar.gz")))


def timed(outcome, *words):
    start = time.monotonic()
    hosts = json.loads(run(*words, "--json"))["hosts"]
    assert all(outcome(host) for host in hosts), hosts[:2]
    return time.monotonic() - start


def main():
    import tempfile

    muster, hosts = sys.argv[1], int((sys.argv[2:] or ["50"])[0])
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        release = prepare(muster, folder, hosts)
        fleet = f"{folder}/fleet.toml"
        apply = (muster, "deploy", "apply", fleet, "--release", release)
        first = timed(lambda host: host["outcome"] == "changed", *apply)
        print(f"first apply to {hosts} hosts: {first:.1f} s")
        for what, limit, outcome, words in [
            ("status", STATUS_MAX_S, lambda host: host["facts"], (muster, "deploy", "status", fleet)),
            ("apply of an unchanged release", APPLY_MAX_S, lambda host: host["outcome"] == "unchanged", apply),
        ]:
            took = [timed(outcome, *words) for _ in range(RUNS)]
            print(f"{what}: median {statistics.median(took):.2f} s, worst {max(took):.2f} s, at most {limit:.0f} s")
            assert max(took) <= limit, what


if sys.argv[1] == "--install":
    install(pathlib.Path(sys.argv[2]))
else:
    main()
