use std::time::Duration;

/// Slot of the back-off. This and the next two are from IEEE 802.11-2020, table 17-21 (20 MHz channels).
pub(super) const SLOT: Duration = Duration::from_micros(9);
/// Pause before an acknowledgement.
pub(super) const SIFS: Duration = Duration::from_micros(16);
/// Idle time before a frame: SIFS and two slots.
pub(super) const DIFS: Duration = Duration::from_micros(34);
/// Smallest contention window, as the largest number of slots: `aCWmin`.
pub(super) const WINDOW_MIN: u32 = 15;
/// Largest contention window: `aCWmax`.
pub(super) const WINDOW_MAX: u32 = 1_023;
/// Most retries of a unicast: `dot11ShortRetryLimit`, 7.
pub(super) const RETRIES_MAX: u32 = 7;

/// Time to sense that another radio started to send (`aCCATime`, below 4 µs), and to detect a preamble (ns-3's
/// `ThresholdPreambleDetectionModel`, 4 µs).
pub(super) const DETECTION: Duration = Duration::from_micros(4);

/// Overhead of a datagram, in bytes: MAC header 24 and checksum 4, LLC and SNAP 8, IPv4 20, UDP 8.
const HEADERS: usize = 24 + 4 + 8 + 20 + 8;
/// Length of an acknowledgement, a complete MAC frame, in bytes.
const ACKNOWLEDGEMENT: usize = 14;
/// Preamble of a frame: training sequences 16 µs, SIGNAL 4 µs.
const PREAMBLE: Duration = Duration::from_micros(20);
/// One OFDM symbol of 24 bits at 6 Mb/s.
const SYMBOL: Duration = Duration::from_micros(4);
const SYMBOL_BITS: usize = 24;
/// SERVICE field of 16 bits and tail of 6 bits.
const SERVICE_AND_TAIL_BITS: usize = 16 + 6;

/// Airtime of a datagram in 802.11a at 6 Mb/s: 196 µs for 64 bytes, as in ns-3.
///
/// That is 20 µs + 4 µs · ⌊(bytes + 69) / 3⌋. The ancestor project's formula has 61 instead of 69 and gives 184 µs, since it
/// omits the 8 bytes of LLC and SNAP. With DIFS and propagation, a hop takes 0.231 ms.
pub(super) fn airtime(datagram_len: usize) -> Duration {
    airtime_of_frame(datagram_len + HEADERS)
}

/// Airtime of an acknowledgement: 44 µs.
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
    fn datagram_of_64_bytes_has_an_airtime_of_196_microseconds() {
        assert_eq!(airtime(64), Duration::from_micros(196));
        assert_eq!(airtime(64) + DIFS, Duration::from_micros(230));
        assert_eq!(acknowledgement_airtime(), Duration::from_micros(44));
    }

    #[test]
    fn airtime_matches_the_formula_with_llc_and_snap() {
        for bytes in 0_u32..1_500 {
            let formula = Duration::from_micros(20 + 4 * u64::from((bytes + 69) / 3));
            assert_eq!(airtime(bytes as usize), formula, "{bytes} bytes");
        }
    }
}
