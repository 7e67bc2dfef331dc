use muster_runtime::diagnostic::Fields;

/// Every field of a drone's file, with what it accepts; the page on drones describes each.
pub(super) const FIELDS: &Fields = &[
    (
        "scenario",
        "the path of a scenario file, as seen from this file's folder: who flies where, and how they talk",
    ),
    (
        "id",
        "the number of a drone or a relay of the scenario, from 0",
    ),
    (
        "swarm",
        "a whole number from 1 to 4294967295: frames of other swarms are not heeded",
    ),
    (
        "stage",
        "\"sim\": nothing but a simulated vehicle is armed; the stages above it are not there yet",
    ),
    (
        "vehicle",
        "\"closed-form\": a vehicle that is computed in real time; \"msp\", a flight controller, is not there yet",
    ),
    (
        "transport",
        "\"udp\" or \"quic\", each with a table of its name",
    ),
    (
        "journal",
        "the path of a folder for this drone alone, as seen from this file's folder; it is made if it is not there",
    ),
    (
        "log",
        "\"human\", for people, or \"json\", an object a line, for programs",
    ),
    (
        "log_level",
        "\"error\", \"warn\", \"info\", \"debug\" or \"trace\"",
    ),
    (
        "keys",
        "a table with `drone`, `fleet`, `roster` and `revoked`, as `muster keys` makes them",
    ),
    (
        "keys.drone",
        "the path of this drone's secret key, as seen from this file's folder",
    ),
    (
        "keys.fleet",
        "the path of the fleet's public key, as seen from this file's folder",
    ),
    (
        "keys.roster",
        "the path of the fleet's roster, as seen from this file's folder",
    ),
    (
        "keys.revoked",
        "the path of the fleet's list of the revoked, as seen from this file's folder",
    ),
    (
        "udp",
        "a table with one of `group`, `broadcast` and `peers`",
    ),
    (
        "udp.bind",
        "the drone's own address and port, as in \"10.0.0.7:4700\"; port 0 for any, which is no use to those that have it \
         among their `peers`",
    ),
    (
        "udp.group",
        "a multicast group's IPv4 address and port, as in \"239.77.0.1:4700\"",
    ),
    (
        "udp.broadcast",
        "a network's IPv4 broadcast address and a port, as in \"10.0.0.255:4700\"",
    ),
    (
        "udp.peers",
        "the addresses and ports of the other drones, at most 1000, as in `[\"10.0.0.8:4700\", \"10.0.0.9:4700\"]`",
    ),
    (
        "udp.interface",
        "the name of a network interface, as in \"wlan0\"",
    ),
    (
        "quic",
        "a table with one of `group`, `broadcast` and `peers`",
    ),
    (
        "quic.bind",
        "the drone's own address and port, as in \"10.0.0.7:4700\"; port 0 for any, which is no use to those that have it \
         among their `peers`",
    ),
    (
        "quic.group",
        "a multicast group's IPv4 address and port, as in \"239.77.0.1:4700\"",
    ),
    (
        "quic.broadcast",
        "a network's IPv4 broadcast address and a port, as in \"10.0.0.255:4700\"",
    ),
    (
        "quic.peers",
        "the addresses and ports of the other drones, at most 1000, as in `[\"10.0.0.8:4700\", \"10.0.0.9:4700\"]`",
    ),
    (
        "quic.interface",
        "the name of a network interface, as in \"wlan0\"",
    ),
    (
        "observe",
        "a table with `http`, where whoever is to know is told what the drone is doing; nobody is without",
    ),
    (
        "observe.http",
        "an address of this machine's and a port, as in \"127.0.0.1:9100\"; whoever reaches it can ask",
    ),
];
