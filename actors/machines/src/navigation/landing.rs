//! Lands: straight down once nobody is below, or beside them.

use super::deconfliction::{LANDING_WAIT_MAX, URGENT_LANDING_WAIT_MAX};
use super::{Navigation, Notice, Progress};
use crate::formation::Path;
use crate::msp::{FlightCommand, Telemetry};
use crate::time::Timestamp;

impl Navigation {
    pub(super) fn monitor_landing(&mut self, now: Timestamp, telemetry: &Telemetry) {
        let column = Path::new(telemetry.stop, telemetry.stop.at_altitude(0.0));
        if !telemetry.armed {
            if std::mem::take(&mut self.awaits_arming) {
                self.command(FlightCommand::Land);
            }
            self.set_progress(Progress::Done);
            self.inform(Notice::Landed);
        } else if telemetry.landing {
            self.announce_descent(now, telemetry);
        } else if self.may_descend(now, column, telemetry) {
            self.announce(now, Some(column), true);
            self.command(FlightCommand::Land);
        } else {
            self.wait_to_descend(now, column, telemetry);
        }
    }

    /// Whether to land now: the column below is clear, or the landing has waited long enough.
    fn may_descend(&self, now: Timestamp, column: Path, telemetry: &Telemetry) -> bool {
        let longest_wait = if self.is_urgent(telemetry) {
            URGENT_LANDING_WAIT_MAX
        } else {
            LANDING_WAIT_MAX
        };
        self.deconfliction.may_descend(now, column, longest_wait)
    }

    /// Whether the battery is almost empty.
    fn is_urgent(&self, telemetry: &Telemetry) -> bool {
        telemetry.charge <= self.config.failsafe.battery_critical
    }

    /// Holds above the traffic below, or flies to a clear landing place beside it. If there is no such place, without a
    /// position, or with an almost empty battery, it announces the descent, so that those below make room.
    fn wait_to_descend(&mut self, now: Timestamp, column: Path, telemetry: &Telemetry) {
        let may_fly = !self.health.is_position_lost() && !self.is_urgent(telemetry);
        let deconfliction = &mut self.deconfliction;
        let detour = deconfliction.landing_detour(now, column);
        let is_on_detour =
            !telemetry.at_rest && may_fly && deconfliction.is_on_detour_to(telemetry.target);
        match detour.filter(|_| telemetry.at_rest && may_fly) {
            Some(side) => {
                deconfliction.wait(now);
                let path = Path::new(column.from, side);
                self.announce(now, Some(path), false);
                let leg = self.config.leg(path.from, side);
                self.command(FlightCommand::Fly(leg));
            }
            None if is_on_detour => _ = deconfliction.wait(now),
            None if telemetry.at_rest && (!may_fly || deconfliction.has_waited_for_detour(now)) => {
                deconfliction.wait(now);
                self.announce_descent(now, telemetry);
            }
            None => self.wait_for_traffic(now, None, telemetry),
        }
    }
}
