//! What each field of a scenario file accepts, in words.

/// What links are named by.
const TWO_GROUPS: &str = "two drones or groups of drones, as in `[2, 3]` or `[[0, 1, 2], [3, 4]]`";

/// Whose frames are tampered with.
const SENDER: &str = "\"all\", or the number of a drone or of a relay";

/// Every field of a scenario file, with what it accepts; the page on scenarios describes each.
pub const FIELDS: &[(&str, &str)] = &[
    ("seed", "a whole number from 0 to 9223372036854775807"),
    ("formation", "a table with `kind`, `drones` and `spacing_m`"),
    (
        "formation.kind",
        "\"linear\", \"circular\", \"random\", \"split-up\", \"compact-mesh\", \"regular-matrix\" or \"compact-matrix\"",
    ),
    ("formation.drones", "a whole number from 1 to 100000"),
    (
        "formation.spacing_m",
        "metres, a number from 0.01 to 100000",
    ),
    (
        "formation.heading_deg",
        "degrees clockwise from north, a number from -360 to 360",
    ),
    (
        "formation.gap_m",
        "metres, a number from 0.01 to 100000, at most `spacing_m`",
    ),
    ("formation.ground", "\"gathered\", \"line\" or \"grid\""),
    (
        "formation.assignment",
        "\"optimal\" (for up to 300 drones) or \"greedy\", where `ground` is \"line\" or \"grid\"",
    ),
    (
        "formation.clusters",
        "a whole number from 2 to 5, where `kind` is \"split-up\"",
    ),
    (
        "formation.cluster_distance_m",
        "metres, a number from 0.01 to 100000, where `kind` is \"split-up\"",
    ),
    (
        "formation.seed",
        "a whole number from 0 to 9223372036854775807, where `kind` is \"random\"",
    ),
    (
        "changes",
        "changes of formation in flight, `[{ waypoint = 1, kind = \"circular\" }, …]` or tables begun by `[[changes]]`, in \
         the order of their waypoints",
    ),
    (
        "changes.waypoint",
        "the number of a waypoint of the mission, 0 being where the take-off ends",
    ),
    (
        "changes.kind",
        "\"linear\", \"circular\", \"random\", \"split-up\", \"compact-mesh\", \"regular-matrix\" or \"compact-matrix\"",
    ),
    ("changes.spacing_m", "metres, a number from 0.01 to 100000"),
    (
        "changes.heading_deg",
        "degrees clockwise from north, a number from -360 to 360",
    ),
    (
        "changes.clusters",
        "a whole number from 2 to 5, where `kind` is \"split-up\"",
    ),
    (
        "changes.cluster_distance_m",
        "metres, a number from 0.01 to 100000, where `kind` is \"split-up\"",
    ),
    (
        "changes.seed",
        "a whole number from 0 to 9223372036854775807, where `kind` is \"random\"",
    ),
    ("mission", "a table with `file`"),
    (
        "mission.file",
        "the path of a QGroundControl `.plan` or `.waypoints` file or of a path in KML, as seen from the scenario's folder",
    ),
    (
        "relays",
        "pure relays, at most 1000 tables begun by `[[relays]]` with `north_m`, `east_m` and `altitude_m`, where \
         `protocol.policy` is \"tree\"",
    ),
    ("relays.north_m", "metres, a number from -100000 to 100000"),
    ("relays.east_m", "metres, a number from -100000 to 100000"),
    (
        "relays.altitude_m",
        "metres above home, a number from 0 to 100000",
    ),
    (
        "swarms",
        "other swarms in the same air and over the same medium, tables begun by `[[swarms]]` with `scenario`, `north_m` \
         and `east_m`",
    ),
    (
        "swarms.scenario",
        "the path of a scenario file, as seen from this one's folder, that has neither `faults` nor `swarms`",
    ),
    ("swarms.north_m", "metres, a number from -100000 to 100000"),
    ("swarms.east_m", "metres, a number from -100000 to 100000"),
    (
        "swarms.after_s",
        "seconds from the start of the run, a number from 0 to 604800",
    ),
    ("radio", "a table with `range_m`"),
    ("radio.range_m", "metres, a number from 0.01 to 100000"),
    (
        "radio.model",
        "\"range\", \"80211a\" or \"nakagami\": how the chance to be heard falls with the distance",
    ),
    (
        "radio.nakagami_m",
        "a shape from 0.5 to 100, with the model \"nakagami\"",
    ),
    ("radio.loss", "a share from 0 to 1"),
    (
        "radio.burst_every_ms",
        "milliseconds, a whole number from 1 to 3600000, with `burst_ms`",
    ),
    (
        "radio.burst_ms",
        "milliseconds, a whole number from 1 to 3600000, with `burst_every_ms`",
    ),
    (
        "radio.burst_loss",
        "a share from 0 to 1, with `burst_every_ms` and `burst_ms`",
    ),
    (
        "radio.medium",
        "\"ideal\" or \"csma\": how radios share the medium",
    ),
    (
        "radio.latency_us",
        "microseconds, a whole number from 0 to 60000000, with the medium \"ideal\"",
    ),
    (
        "radio.jitter_us",
        "microseconds, a whole number from 0 to 60000000",
    ),
    (
        "radio.queue_max",
        "a whole number from 1 to 1000000, with the medium \"csma\"",
    ),
    ("protocol", "a table with `policy`"),
    (
        "protocol.kind",
        "\"muscop\", from waypoint to waypoint, or \"follow\", after a master that waits for nobody",
    ),
    ("protocol.policy", "\"flood\" or \"tree\""),
    (
        "protocol.barrier",
        "\"strict\", or \"neighbours\" where `kind` is \"muscop\" and there are no `changes`",
    ),
    ("protocol.liveness", "\"heartbeat\" or \"thesis\""),
    (
        "protocol.succession",
        "\"elect\" or \"land\": what drones do whose master is silent",
    ),
    ("protocol.parameters", "\"quiet\", \"fast\" or \"lan\""),
    (
        "protocol.period_ms",
        "milliseconds, a whole number from 1 to 3600000",
    ),
    (
        "protocol.keep_alive_ms",
        "milliseconds, a whole number from 1 to 3600000",
    ),
    (
        "protocol.hello_period_ms",
        "milliseconds, a whole number from 1 to 3600000",
    ),
    (
        "protocol.hello_gap_ms",
        "milliseconds, a whole number from 1 to 3600000, above `hello_period_ms`",
    ),
    (
        "protocol.discovery_ms",
        "milliseconds, a whole number from 1 to 3600000",
    ),
    ("protocol.stable_after", "a whole number from 1 to 1000"),
    (
        "protocol.time_to_live_ms",
        "milliseconds, a whole number from 1 to 3600000, above `period_ms`",
    ),
    (
        "protocol.heartbeat_ms",
        "milliseconds, a whole number from 1 to 3600000",
    ),
    (
        "protocol.repair_ms",
        "milliseconds, a whole number from 1 to 3600000",
    ),
    ("follow", "a table, where `protocol.kind` is \"follow\""),
    (
        "follow.period_ms",
        "milliseconds, a whole number from 1 to 1000",
    ),
    (
        "follow.hold_ms",
        "milliseconds, a whole number from 1 to 5000, above `period_ms`",
    ),
    (
        "follow.speed_mps",
        "m/s, a number from 0.01 to 100, at most `vehicle.speed_mps`",
    ),
    (
        "follow.acceleration_mps2",
        "m/s², a number from 0.01 to 100, at most `vehicle.acceleration_mps2`",
    ),
    (
        "follow.pilot",
        "what a pilot does, tables begun by `[[follow.pilot]]` with `after_s`, `north_mps`, `east_mps` and `climb_mps`",
    ),
    (
        "follow.pilot.after_s",
        "seconds after the following began, a number from 0 to 604800, not before the one above",
    ),
    ("follow.pilot.north_mps", "m/s, a number from -100 to 100"),
    ("follow.pilot.east_mps", "m/s, a number from -100 to 100"),
    (
        "follow.pilot.climb_mps",
        "m/s upwards, a number from -100 to 100",
    ),
    (
        "follow.land_after_s",
        "seconds after the following began, a number from 0 to 604800, where a pilot flies",
    ),
    ("vehicle", "a table"),
    ("vehicle.speed_mps", "m/s, a number from 0.01 to 100"),
    (
        "vehicle.acceleration_mps2",
        "m/s², a number from 0.01 to 100",
    ),
    ("vehicle.climb_mps", "m/s, a number from 0.01 to 100"),
    ("vehicle.descent_mps", "m/s, a number from 0.01 to 100"),
    ("vehicle.landing_mps", "m/s, a number from 0.01 to 100"),
    (
        "vehicle.landing_altitude_m",
        "metres, a number from 0 to 100000",
    ),
    (
        "vehicle.settle_ms",
        "milliseconds, a whole number from 0 to 60000",
    ),
    (
        "vehicle.endurance_s",
        "seconds, a number from 0.001 to 604800",
    ),
    ("failsafe", "a table"),
    (
        "failsafe.alone",
        "\"carry-on\" or \"land\": what a drone does that hears of nobody else",
    ),
    (
        "failsafe.position_hold_s",
        "seconds, a number from 0 to 604800",
    ),
    (
        "failsafe.battery_low",
        "a share from 0 to 1, above `battery_critical`",
    ),
    (
        "failsafe.battery_critical",
        "a share from 0 to 1, below `battery_low`",
    ),
    ("safety", "a table"),
    (
        "safety.avoid",
        "true or false: whether drones say where they are and go, and give way to each other",
    ),
    ("geofence", "a table with `radius_m`"),
    (
        "geofence.radius_m",
        "metres from home over ground, a number from 0.01 to 100000",
    ),
    (
        "geofence.altitude_max_m",
        "metres above home, a number from 0.01 to 100000",
    ),
    ("limits", "a table"),
    (
        "limits.separation_horizontal_m",
        "metres, a number from 0.01 to 100000",
    ),
    (
        "limits.separation_vertical_m",
        "metres, a number from 0.01 to 100000",
    ),
    (
        "limits.altitude_max_m",
        "metres above home, a number from 0.01 to 100000",
    ),
    (
        "limits.duration_s",
        "seconds, a number from 0.001 to 604800",
    ),
    ("limits.set_up_s", "seconds, a number from 0.001 to 604800"),
    (
        "limits.take_off_s",
        "seconds, a number from 0.001 to 604800",
    ),
    ("limits.leg_s", "seconds, a number from 0.001 to 604800"),
    (
        "limits.flight_time_s",
        "seconds, a number from 0.001 to 604800",
    ),
    ("limits.waiting_max", "a whole number from 8 to 1000000"),
    ("limits.restarts_max", "a whole number from 0 to 1000000"),
    (
        "limits.hang_ms",
        "milliseconds, a whole number from 1 to 3600000",
    ),
    (
        "limits.watchdog_ms",
        "milliseconds, a whole number from 1 to 3600000",
    ),
    (
        "limits.controller_s",
        "seconds, a number from 0.001 to 604800",
    ),
    (
        "limits.restart_window_s",
        "seconds, a number from 0.001 to 604800",
    ),
    (
        "limits.accept",
        "a list of \"late\", \"apart\", \"descends\" and \"killed\", or of some of them",
    ),
    (
        "faults",
        "tables, each begun by a line `[[faults]]`: when, by `at_s`, `at_waypoint` or `when`, and one of `crash`, \
         `hang`, `restart`, `kill`, `crash_aircraft`, `lose_gps`, `drain`, `cut`, `one_way`, `degrade`, `heal`, `jam`, `corrupt`, \
         `duplicate`, `delay`, `reorder`, `replay`, `forge`, `skew`",
    ),
    (
        "faults.at_s",
        "seconds from the start of the run, a number from 0 to 604800",
    ),
    (
        "faults.at_waypoint",
        "the number of a waypoint of the mission, which the first drone has then reached, 0 being where the take-off ends",
    ),
    (
        "faults.when",
        "\"taking-off\", \"elected\", \"settled\" or \"landing\", for the first time",
    ),
    (
        "faults.after_s",
        "seconds later than `at_waypoint` or `when` says, a number from 0 to 604800",
    ),
    (
        "faults.for_s",
        "seconds after which it is over, a number from 0.001 to 604800, with a fault that lasts",
    ),
    (
        "faults.times",
        "how often it happens, a whole number from 1 to 100000, with `every_s`",
    ),
    (
        "faults.every_s",
        "seconds from one time to the next, a number from 0.001 to 604800, with `times`",
    ),
    (
        "faults.crash",
        "\"master\", or the number of a drone or of a relay, with `actor`",
    ),
    (
        "faults.actor",
        "an actor: \"radio\", \"routing\", \"mission\", \"navigation\" or \"msp\", with `crash` or `hang`",
    ),
    (
        "faults.hang",
        "\"master\", or the number of a drone or of a relay; with `actor`, only that actor",
    ),
    (
        "faults.restart",
        "\"master\", or the number of a drone or of a relay",
    ),
    (
        "faults.kill",
        "\"master\", or the number of a drone or of a relay",
    ),
    (
        "faults.crash_aircraft",
        "\"master\", or the number of a drone or of a relay",
    ),
    (
        "faults.lose_gps",
        "\"master\", or the number of a drone or of a relay",
    ),
    (
        "faults.drain",
        "\"master\", or the number of a drone or of a relay, with `to`",
    ),
    ("faults.to", "a share from 0 to 1, with `drain`"),
    ("faults.cut", TWO_GROUPS),
    ("faults.one_way", TWO_GROUPS),
    ("faults.degrade", TWO_GROUPS),
    ("faults.heal", TWO_GROUPS),
    ("faults.loss", "a share from 0 to 1, with `degrade`"),
    (
        "faults.jam",
        "a disc, `{ north_m = 0, east_m = 0, radius_m = 100 }`, in metres from home",
    ),
    ("faults.corrupt", SENDER),
    ("faults.duplicate", SENDER),
    (
        "faults.delay",
        "\"all\", or the number of a drone or of a relay, with `by_ms`",
    ),
    (
        "faults.reorder",
        "\"all\", or the number of a drone or of a relay, with `by_ms`",
    ),
    (
        "faults.share",
        "a share from 0 to 1, with `corrupt`, `duplicate`, `delay` or `reorder`",
    ),
    (
        "faults.by_ms",
        "milliseconds, a whole number from 1 to 3600000, with `delay` or `reorder`",
    ),
    (
        "faults.replay",
        "\"master\", or the number of a drone or of a relay",
    ),
    (
        "faults.forge",
        "\"master\", or the number of a drone or of a relay",
    ),
    (
        "faults.skew",
        "\"master\", or the number of a drone or of a relay, with `ppm`",
    ),
    (
        "faults.ppm",
        "millionths that a clock gains, a whole number from -500000 to 500000, with `skew`",
    ),
    ("chaos", "a table with `faults_max` and `vary`"),
    ("chaos.faults_max", "a whole number from 1 to 100"),
    (
        "chaos.vary",
        "a table of fields and lists of their values, as in `\"formation.drones\" = [5, 8]`",
    ),
];
