use muster_runtime::diagnostic::Fields;

/// Every field of a hosts file, with what it accepts; the page on drones describes each.
pub(super) const FIELDS: &Fields = &[
    (
        "group",
        "a multicast group's IPv4 address and port, as in \"239.77.0.1:4700\"",
    ),
    (
        "broadcast",
        "the hosts' network's IPv4 broadcast address and a port, as in \"10.0.0.255:4700\"",
    ),
    (
        "hosts",
        "a table `[[hosts]]` for each host, with the drones that fly there",
    ),
    (
        "hosts.drones",
        "the numbers of the drones and relays whose processes run there, as in `[0, 1]`: each of the scenario's at one host",
    ),
    (
        "hosts.run",
        "the command, with its arguments, that runs another command there and passes its input and output on, as in \
         `[\"ssh\", \"pi@10.0.0.7\"]`; this machine runs it without",
    ),
    (
        "hosts.musterd",
        "where the daemon's program is there, a path or a name of letters, digits and any of `/._-+`",
    ),
    (
        "hosts.interface",
        "the name of the network interface there that drones talk over, as in \"wlan0\"",
    ),
    (
        "hosts.address",
        "the address there of the first of its drones, as in \"10.0.0.7:4700\"; the next ones have the ports after it",
    ),
];
