//! KML (OGC 07-147r2) with Google's `gx:Track`, for Google Earth.

use std::fmt::Write as _;

use muster_machines::geodetic::Geodetic;
use muster_machines::geometry::Ned;
use muster_machines::time::Timestamp;
use muster_scenarios::report::{Flight, Report};

use super::colours;
use super::place::{Place, date, home, marks, place};

/// The run as KML: a track of each drone, and a point for each mark.
///
/// Altitudes are above sea level. A mission file without home's altitude has them above ground.
pub(super) fn kml(report: &Report, flight: &Flight) -> String {
    let mut text = String::new();
    let memory = "writing to a string never fails";
    let name = escaped(&format!("{}, seed {}", report.name(), report.seed));
    let home = home(flight);
    write!(
        text,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <kml xmlns=\"http://www.opengis.net/kml/2.2\" xmlns:gx=\"http://www.google.com/kml/ext/2.2\">\n<Document>\n\
         <name>{name}</name>\n"
    )
    .expect(memory);
    for index in 0..8 {
        styles(&mut text, index);
    }
    text.push_str("<Folder>\n<name>drones</name>\n");
    let swarms = report.swarms().zip(flight.swarms());
    let drones = swarms.flat_map(|(report, flight)| report.drones.iter().zip(&flight.drones));
    for (index, (drone, flown)) in drones.enumerate() {
        let about = format!("drone {}", drone.id);
        write!(
            text,
            "<Placemark>\n<name>{about}</name>\n<description>{}</description>\n<styleUrl>#drone-{}</styleUrl>\n",
            escaped(&drone.state),
            index % 8
        )
        .expect(memory);
        track(&mut text, home, &flown.track);
        text.push_str("</Placemark>\n");
    }
    text.push_str("</Folder>\n<Folder>\n<name>what happened</name>\n");
    for (mark, at) in marks(report, flight) {
        let Place {
            latitude_deg,
            longitude_deg,
            altitude_m,
        } = place(home, at);
        write!(
            text,
            "<Placemark>\n<name>{}</name>\n<description>{}</description>\n<TimeStamp><when>{}</when></TimeStamp>\n\
             <Point><altitudeMode>{}</altitudeMode><coordinates>{longitude_deg},{latitude_deg},{altitude_m}</coordinates>\
             </Point>\n</Placemark>\n",
            escaped(mark.kind.name()),
            escaped(&mark.text),
            date(mark.at),
            mode(home),
        )
        .expect(memory);
    }
    text.push_str("</Folder>\n</Document>\n</kml>\n");
    text
}

/// Style of every eighth drone. KML's colours are alpha, blue, green, red.
fn styles(text: &mut String, index: usize) {
    let [red, green, blue] = colours::epoch(Some(index));
    let colour = format!("ff{blue:02x}{green:02x}{red:02x}");
    writeln!(
        text,
        "<Style id=\"drone-{index}\"><IconStyle><color>{colour}</color></IconStyle>\
         <LineStyle><color>{colour}</color><width>2</width></LineStyle></Style>"
    )
    .expect("writing to a string never fails");
}

fn track(text: &mut String, home: Geodetic, track: &[(Timestamp, Ned)]) {
    let memory = "writing to a string never fails";
    writeln!(
        text,
        "<gx:Track>\n<altitudeMode>{}</altitudeMode>",
        mode(home)
    )
    .expect(memory);
    for (at, _) in track {
        writeln!(text, "<when>{}</when>", date(*at)).expect(memory);
    }
    for (_, position) in track {
        let Place {
            latitude_deg,
            longitude_deg,
            altitude_m,
        } = place(home, *position);
        writeln!(
            text,
            "<gx:coord>{longitude_deg} {latitude_deg} {altitude_m}</gx:coord>"
        )
        .expect(memory);
    }
    text.push_str("</gx:Track>\n");
}

/// Above sea level if home's altitude is known; files that have none are read as 0.
fn mode(home: Geodetic) -> &'static str {
    if home.altitude_m().abs() > f64::EPSILON {
        "absolute"
    } else {
        "relativeToGround"
    }
}

/// `text` as content of an XML element.
pub(super) fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            // XML 1.0 has no control characters but these.
            c if c.is_control() && !matches!(c, '\n' | '\t') => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}
