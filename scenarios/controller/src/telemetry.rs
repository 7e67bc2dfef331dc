//! What a controller answers about its state and its sensors.

use muster_machines::geodetic::{Geodetic, latitude_longitude_altitude};
use muster_msp::{
    Altitude, Analog, ArmingFlags, Attitude, BatteryState, CompGps, Counted, Message, Motor,
    RawGps, RawImu, Rc, Sensors as Found, Sonar, Status, StatusEx, StatusFlags, StatusHead, Unused,
};

use crate::aircraft::Aircraft;
use crate::airframe::GRAVITY_MPS2;
use crate::firmware::Firmware;
use crate::firmware::arming::Refusal;
use crate::firmware::receiver::{PITCH, ROLL, THROTTLE, YAW};
use crate::sensors::Sensors;
use crate::serial::{Request, Serial};

/// Accelerometer, barometer, magnetometer, GPS, rangefinder, gyro.
const SENSORS_FOUND: u16 = 0b11_1111;

/// Counts of the accelerometer for standard gravity, as Betaflight's simulation has them.
const COUNTS_A_G: f64 = 256.0;

/// Counts of the magnetometer for a gauss (HMC5883L).
const COUNTS_A_GAUSS: f64 = 1_090.0;

/// Satellites of a fix, and its position dilution of precision in hundredths.
const SATELLITES: u8 = 14;
const PDOP_E2: u16 = 150;

/// What telemetry is made of.
pub(crate) struct View<'a> {
    pub(crate) step: u64,
    pub(crate) origin: Geodetic,
    pub(crate) aircraft: &'a Aircraft,
    pub(crate) firmware: &'a Firmware,
    pub(crate) sensors: &'a mut Sensors,
}

impl View<'_> {
    /// Answers a request for the state. Yields whether it knew the command.
    pub(crate) fn state(&self, serial: &mut Serial, request: &Request) -> bool {
        match request.command {
            Status::COMMAND => {
                let status = Status {
                    head: self.head(),
                    unused: Unused,
                    flags: self.flags(),
                };
                serial.reply(request, &status);
            }
            StatusEx::COMMAND => {
                let status = StatusEx {
                    head: self.head(),
                    pid_profiles: 4,
                    rate_profile: 0,
                    flags: self.flags(),
                };
                serial.reply(request, &status);
            }
            Rc::COMMAND => serial.reply(request, &self.channels()),
            Motor::COMMAND => {
                let mut outputs_us = [0; 8];
                for (output_us, duty) in outputs_us.iter_mut().zip(self.firmware.last_duties()) {
                    *output_us = unsigned(1_000.0 + 1_000.0 * duty);
                }
                serial.reply(request, &Motor { outputs_us });
            }
            Analog::COMMAND => serial.reply(request, &self.analog()),
            BatteryState::COMMAND => serial.reply(request, &self.battery()),
            _ => return false,
        }
        true
    }

    /// Answers a request for a measurement. Yields whether it knew the command.
    pub(crate) fn measurement(&mut self, serial: &mut Serial, request: &Request) -> bool {
        match request.command {
            Attitude::COMMAND => serial.reply(request, &self.attitude()),
            Altitude::COMMAND => {
                let altitude = &self.firmware.altitude;
                let altitude = Altitude {
                    altitude_cm: whole(altitude.shown_m() * 100.0),
                    climb_cmps: signed(altitude.climb_mps() * 100.0),
                };
                serial.reply(request, &altitude);
            }
            RawImu::COMMAND => serial.reply(request, &self.imu()),
            RawGps::COMMAND => serial.reply(request, &self.gps()),
            CompGps::COMMAND => serial.reply(request, &self.home()),
            Sonar::COMMAND => {
                let (body, height_m) = (&self.aircraft.body, self.aircraft.height_m());
                let found_m = self.sensors.rangefinder_m(self.step, body, height_m);
                let height_cm = found_m.map_or(-1, |height_m| whole(height_m * 100.0));
                serial.reply(request, &Sonar { height_cm });
            }
            _ => return false,
        }
        true
    }

    fn head(&self) -> StatusHead {
        let order = self.firmware.settings.mode_order();
        let bits = order
            .enumerate()
            .map(|(place, mode)| u32::from(self.firmware.is_active(mode)) << place);
        StatusHead {
            cycle_us: 125,
            i2c_errors: 0,
            sensors: Found(SENSORS_FOUND),
            modes: bits.sum(),
            pid_profile: 0,
            load_percent: 20,
        }
    }

    fn flags(&self) -> StatusFlags {
        let count = self.firmware.settings.arming_flags();
        let refusals = self.firmware.refusals();
        let switch = 1 << Refusal::ArmSwitch as u8;
        let last = u32::from(refusals & switch != 0) << (count - 1);
        StatusFlags {
            further_modes: Counted::default(),
            arming: ArmingFlags {
                count,
                bits: refusals & !switch | last,
            },
            state: Some(0),
            core_celsius: Some(40),
            rate_profiles: None,
        }
    }

    fn channels(&self) -> Rc {
        let channels = self.firmware.receiver.channels();
        Rc {
            roll_us: channels[ROLL],
            pitch_us: channels[PITCH],
            yaw_us: channels[YAW],
            throttle_us: channels[THROTTLE],
            aux_us: channels[4..].to_vec(),
        }
    }

    fn analog(&self) -> Analog {
        let battery = self.battery();
        Analog {
            voltage_dv: battery.voltage_dv,
            drawn_mah: battery.drawn_mah,
            rssi: if self.firmware.receiver.is_receiving() {
                1_023
            } else {
                0
            },
            current_ca: battery.current_ca,
            voltage_cv: battery.voltage_cv,
        }
    }

    fn battery(&self) -> BatteryState {
        let (monitor, battery) = (&self.firmware.power, &self.aircraft.battery);
        let voltage_cv = unsigned(monitor.volts() * 100.0);
        BatteryState {
            cells: monitor.cells(),
            capacity_mah: 0,
            voltage_dv: u8::try_from((voltage_cv + 5) / 10).unwrap_or(u8::MAX),
            drawn_mah: unsigned(battery.used_mah()),
            current_ca: signed(battery.amps() * 100.0),
            level: monitor.level(),
            voltage_cv: Some(voltage_cv),
        }
    }

    fn attitude(&self) -> Attitude {
        let [roll, pitch, heading] = self.firmware.angles_rad();
        let heading_deg = libm::round(heading.to_degrees()).rem_euclid(360.0);
        Attitude {
            roll_ddeg: signed(roll.to_degrees() * 10.0),
            pitch_ddeg: signed(-pitch.to_degrees() * 10.0),
            yaw_deg: signed(heading_deg),
        }
    }

    /// Betaflight's axes: forward, left, up.
    fn imu(&mut self) -> RawImu {
        let body = &self.aircraft.body;
        let axes = |vector: nalgebra::Vector3<f64>, scale: f64| {
            [vector.x, -vector.y, -vector.z].map(|value| signed(value * scale))
        };
        let acceleration = self.sensors.acceleration(self.step, body);
        let rates = self.sensors.rates(self.step, body);
        RawImu {
            acceleration: axes(acceleration, COUNTS_A_G / GRAVITY_MPS2),
            rate_dps: axes(rates, 180.0 / std::f64::consts::PI),
            magnetic: axes(Sensors::field(body), COUNTS_A_GAUSS),
        }
    }

    fn gps(&self) -> RawGps {
        let Some(fix) = self.sensors.gps.fix() else {
            return RawGps::default();
        };
        let [latitude, longitude, altitude_m] = latitude_longitude_altitude(self.origin, fix.place);
        let (north, east) = (fix.velocity.x, fix.velocity.y);
        let course_deg = libm::atan2(east, north).to_degrees().rem_euclid(360.0);
        RawGps {
            fix: 1,
            satellites: SATELLITES,
            latitude_e7: whole(latitude * 1e7),
            longitude_e7: whole(longitude * 1e7),
            altitude_m: unsigned(altitude_m),
            speed_cmps: unsigned(libm::hypot(north, east) * 100.0),
            course_ddeg: unsigned(course_deg * 10.0) % 3_600,
            pdop_e2: Some(PDOP_E2),
        }
    }

    fn home(&self) -> CompGps {
        let update = u8::from(self.sensors.gps.number() % 2 == 1);
        let Some((home, fix)) = self.firmware.home().zip(self.sensors.gps.fix()) else {
            return CompGps {
                update,
                ..CompGps::default()
            };
        };
        let away = home - fix.place;
        let direction_deg = libm::atan2(away.east_m(), away.north_m()).to_degrees();
        CompGps {
            home_m: unsigned(home.horizontal_distance_m(fix.place)),
            home_deg: unsigned(direction_deg.rem_euclid(360.0)) % 360,
            update,
        }
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates, as the firmware's fields do"
)]
fn unsigned(value: f64) -> u16 {
    libm::round(value) as u16
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the cast saturates, as the firmware's fields do"
)]
fn signed(value: f64) -> i16 {
    libm::round(value) as i16
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the cast saturates, as the firmware's fields do"
)]
fn whole(value: f64) -> i32 {
    libm::round(value) as i32
}
