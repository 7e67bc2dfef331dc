use std::time::Duration;

/// A slot of the back-off: IEEE 802.11-2020, table 17-21, as the next two (20 MHz channels).
pub(super) const SLOT: Duration = Duration::from_micros(9);
/// The pause before an acknowledgement.
pub(super) const SIFS: Duration = Duration::from_micros(16);
/// How long the medium has to be idle before a frame: SIFS and two slots.
pub(super) const DIFS: Duration = Duration::from_micros(34);
/// The first contention window, in slots above 0: `aCWmin`.
pub(super) const WINDOW_MIN: u32 = 15;
/// The last: `aCWmax`.
pub(super) const WINDOW_MAX: u32 = 1_023;
/// How often a frame for one drone is tried again: `dot11ShortRetryLimit`, 7.
pub(super) const RETRIES_MAX: u32 = 7;

/// How long a radio takes to notice that somebody began to send (`aCCATime`, below 4 µs), and to make out a preamble
/// (ns-3's `ThresholdPreambleDetectionModel`, 4 µs).
pub(super) const DETECTION: Duration = Duration::from_micros(4);

/// What is around a datagram on the air, in bytes: MAC header 24 and checksum 4, LLC and SNAP 8, IPv4 20, UDP 8.
const HEADERS: usize = 24 + 4 + 8 + 20 + 8;
/// An acknowledgement, in bytes: it is a MAC frame of its own.
const ACKNOWLEDGEMENT: usize = 14;
/// What goes before a frame: training sequences 16 µs, SIGNAL 4 µs.
const PREAMBLE: Duration = Duration::from_micros(20);
/// One OFDM symbol, which is 24 bits at 6 Mb/s.
const SYMBOL: Duration = Duration::from_micros(4);
const SYMBOL_BITS: usize = 24;
/// SERVICE 16 bits before a frame and 6 bits of tail after it.
const SERVICE_AND_TAIL_BITS: usize = 16 + 6;

/// How long a datagram of so many bytes is on the air, in 802.11a at 6 Mb/s: 196 µs for 64 bytes, as in ns-3.
///
/// That is 20 µs + 4 µs · ⌊(bytes + 69) / 3⌋. The ancestor's formula has 61 in the place of 69 and so gives 184 µs:
/// it leaves out the 8 bytes of LLC and SNAP. With DIFS and the way through the air a hop comes to 0.231 ms.
pub(super) fn airtime(datagram_len: usize) -> Duration {
    airtime_of_frame(datagram_len + HEADERS)
}

/// How long an acknowledgement is on the air: 44 µs.
pub(super) fn acknowledgement_airtime() -> Duration {
    airtime_of_frame(ACKNOWLEDGEMENT)
}

fn airtime_of_frame(bytes: usize) -> Duration {
    let symbols = (SERVICE_AND_TAIL_BITS + 8 * bytes).div_ceil(SYMBOL_BITS);
    PREAMBLE + SYMBOL * u32::try_from(symbols).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_datagram_of_64_bytes_is_on_the_air_for_196_microseconds() {
        assert_eq!(airtime(64), Duration::from_micros(196));
        assert_eq!(airtime(64) + DIFS, Duration::from_micros(230));
        assert_eq!(acknowledgement_airtime(), Duration::from_micros(44));
    }

    #[test]
    fn the_ancestors_formula_is_eight_bytes_short() {
        for bytes in 0_u32..1_500 {
            let formula = Duration::from_micros(20 + 4 * u64::from((bytes + 69) / 3));
            assert_eq!(airtime(bytes as usize), formula, "{bytes} bytes");
        }
    }
}
