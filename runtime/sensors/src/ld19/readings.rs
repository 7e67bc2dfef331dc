//! From packets to readings.

use std::time::Duration;

use muster_indoor::reading::{Echo, Mounting, Reading};

use super::decoder::{CLOCK_MS, Packet, Point};

/// Two turns at 10 Hz.
const USED: Duration = Duration::from_millis(200);
/// Weaker echoes are mostly dust and edges. Source: LDROBOT's driver for the LD06 (`ldlidar_stl_ros2`, `tofbf.h`), low intensity.
const CONFIDENCE_MIN: u8 = 15;

/// The readings of packets that were read at once, in the order in which they came. The last one was taken at `now`, those
/// before as much earlier as the lidar's clock says.
pub(super) fn of_packets(
    packets: &[Packet],
    mounting: Mounting,
    now: Duration,
) -> impl Iterator<Item = Reading> {
    let newest_ms = packets.last().map_or(0, |packet| packet.time_ms);
    packets.iter().flat_map(move |packet| {
        let age_ms = (newest_ms + CLOCK_MS - packet.time_ms) % CLOCK_MS;
        let taken = now.saturating_sub(Duration::from_millis(age_ms.into()));
        let points = packet.points.into_iter();
        points.map(move |point| of_point(point, mounting, taken))
    })
}

fn of_point(point: Point, mounting: Mounting, taken: Duration) -> Reading {
    let clockwise_rad = (f64::from(point.angle_cdeg) / 100.0).to_radians();
    Reading {
        mounting: Mounting {
            bearing_rad: mounting.bearing_rad - clockwise_rad,
            aperture_rad: 0.0,
            ..mounting
        },
        echo: match point.range_mm {
            0 => Echo::Silence,
            _ if point.confidence < CONFIDENCE_MIN => Echo::Failed,
            range_mm => Echo::At(f64::from(range_mm) / 1_000.0),
        },
        taken,
        expires: taken + USED,
    }
}

#[cfg(test)]
mod tests {
    use muster_indoor::frames::BodyXy;

    use super::*;

    fn packet(time_ms: u16) -> Packet {
        let point = Point {
            angle_cdeg: 0,
            range_mm: 1_000,
            confidence: 200,
        };
        Packet {
            speed_dps: 3_600,
            time_ms,
            points: [point; 12],
        }
    }

    /// The ages of packets with these times, read at 100 s; milliseconds.
    fn ages_ms(times_ms: &[u16]) -> Vec<u128> {
        let packets: Vec<Packet> = times_ms.iter().map(|it| packet(*it)).collect();
        let now = Duration::from_secs(100);
        let lidar = Mounting::laser(BodyXy::new(0.0, 0.0), 0.0, 12.0);
        let readings: Vec<Reading> = of_packets(&packets, lidar, now).collect();
        assert_eq!(readings.len(), 12 * packets.len());
        readings
            .iter()
            .step_by(12)
            .map(|it| it.age(now).as_millis())
            .collect()
    }

    #[test]
    fn ranges_that_waited_in_the_port_are_old() {
        assert_eq!(ages_ms(&[500, 700, 800]), [300, 100, 0]);
    }

    #[test]
    fn ages_hold_when_the_lidars_clock_begins_again() {
        assert_eq!(ages_ms(&[29_990, 30_000, 5]), [15, 5, 0]);
        assert_eq!(ages_ms(&[29_990, 30_000]), [10, 0]);
    }

    #[test]
    fn a_range_older_than_two_turns_is_not_used() {
        let lidar = Mounting::laser(BodyXy::new(0.0, 0.0), 0.0, 12.0);
        let now = Duration::from_secs(100);
        let packets = [packet(1_000), packet(1_250)];
        let readings: Vec<Reading> = of_packets(&packets, lidar, now).collect();
        let used = readings.iter().filter(|it| it.range_m(now).is_some());
        assert_eq!(used.count(), 12);
    }
}
