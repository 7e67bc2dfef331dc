//! Motors, battery, arming, serial ports.

use super::Findings;
use crate::configuration::Configuration;
use crate::message::{CellLimits, FeatureConfig, MotorProtocol, SerialPort};

/// RC at 50 Hz and telemetry at 50 Hz need about 4 kB/s each way; less than this can't carry them in time.
const BAUD_MIN: u32 = 115_200;
/// Largest tilt on the ground, in °. Betaflight's default is 25.
const TILT_MAX_DEG: u8 = 60;
/// Bit of `BoardInfo::problems`.
const NOT_CALIBRATED: u32 = 1;

pub(super) fn check(configuration: &Configuration, findings: &mut Findings) {
    check_motors(configuration, findings);
    check_battery(configuration, findings);
    check_serial(&configuration.serial.ports, findings);
    let tilt_deg = configuration.arming.small_angle_deg;
    if tilt_deg > TILT_MAX_DEG {
        findings.add(
            "small-angle",
            "it arms lying on its side",
            format!("{tilt_deg}°"),
            "set small_angle = 25",
        );
    }
    let problems = configuration.identity.board.problems.unwrap_or(0);
    if problems & NOT_CALIBRATED != 0 {
        findings.add(
            "accelerometer",
            "it doesn't know what is level",
            "not calibrated",
            "lay it level and calibrate the accelerometer in Betaflight's app",
        );
    }
}

fn check_motors(configuration: &Configuration, findings: &mut Findings) {
    let features = &configuration.features;
    if features.has(FeatureConfig::MOTOR_STOP) {
        findings.add(
            "motor-stop",
            "motors stand still while the throttle is closed, in the air, too",
            "feature MOTOR_STOP is on",
            "feature -MOTOR_STOP",
        );
    }
    if features.has(FeatureConfig::REVERSIBLE) {
        findings.add(
            "reversible",
            "a closed throttle is full thrust downwards",
            "feature 3D is on",
            "feature -3D",
        );
    }
    if matches!(
        configuration.motors.motor_protocol,
        MotorProtocol::Disabled | MotorProtocol::Other(_)
    ) {
        let is_simulation = configuration.identity.board.is_simulation();
        let protocol = if is_simulation { "PWM" } else { "DSHOT300" };
        findings.add(
            "motor-protocol",
            "no motor protocol is set: the motors get no signal",
            configuration.motors.motor_protocol,
            format!("set motor_pwm_protocol = {protocol}"),
        );
    }
}

fn check_battery(configuration: &Configuration, findings: &mut Findings) {
    let battery = &configuration.battery;
    if battery.voltage_source == 0 && !configuration.identity.board.is_simulation() {
        findings.add(
            "battery-meter",
            "an empty battery is not detected",
            "no voltage is measured",
            "set battery_meter = ADC",
        );
    }
    let CellLimits {
        min_cv,
        max_cv,
        warning_cv,
    } = battery.cell();
    let volts = |centivolts: u16| format!("{:.2} V", f64::from(centivolts) / 100.0);
    if !(280..=360).contains(&min_cv) {
        findings.add(
            "battery-min",
            "an empty cell has 2.80 to 3.60 V",
            volts(min_cv),
            "set vbat_min_cell_voltage = 330",
        );
    }
    if !(410..=445).contains(&max_cv) {
        findings.add(
            "battery-max",
            "a full cell has 4.10 to 4.45 V; cells are counted by it",
            volts(max_cv),
            "set vbat_max_cell_voltage = 430",
        );
    }
    if warning_cv < min_cv.saturating_add(10) || warning_cv.saturating_add(20) > max_cv {
        findings.add(
            "battery-warning",
            "the warning must leave charge to land: 0.10 V above empty, 0.20 V below full",
            volts(warning_cv),
            "set vbat_warning_cell_voltage = 350",
        );
    }
}

fn check_serial(ports: &[SerialPort], findings: &mut Findings) {
    let slow = |port: &&SerialPort| {
        port.is_msp()
            && port.identifier != SerialPort::USB
            && port.msp_baud().is_none_or(|it| it < BAUD_MIN)
    };
    for port in ports.iter().filter(slow) {
        let baud = port
            .msp_baud()
            .map_or("automatic".to_owned(), |it| it.to_string());
        findings.add(
            "serial-speed",
            "too slow for RC and telemetry",
            format!("MSP on port {} at {baud} Bd", port.identifier),
            format!("serial {} 1 115200 57600 0 115200", port.identifier),
        );
    }
}
