//! Motors.

use super::{code, message};

message! {
    /// What the motors are told.
    Motor = 104 as "MSP_MOTOR" {
        /// Motor 1 first, in µs: 1,000 is stopped; 0 for a motor that isn't there.
        outputs_us: [u16; 8],
    }
}

code! {
    /// How motor controllers are told.
    MotorProtocol {
        Pwm = 0 "PWM",
        Oneshot125 = 1 "ONESHOT125",
        Oneshot42 = 2 "ONESHOT42",
        Multishot = 3 "MULTISHOT",
        Brushed = 4 "BRUSHED",
        Dshot150 = 5 "DSHOT150",
        Dshot300 = 6 "DSHOT300",
        Dshot600 = 7 "DSHOT600",
        Proshot1000 = 8 "PROSHOT1000",
        Disabled = 9 "DISABLED",
    }
}

message! {
    /// Control loop and motors.
    AdvancedConfig = 90 as "MSP_ADVANCED_CONFIG" {
        /// 1.
        gyro_denominator: u8,
        /// Gyroscope samples a control cycle.
        pid_denominator: u8,
        /// Motors are told at a rate of their own.
        continuous_update: u8,
        /// How they are told.
        motor_protocol: MotorProtocol,
        /// At which rate, in Hz, if it is one of their own.
        motor_hz: u16,
        /// Idle, in 0.01 %.
        idle_percent_e2: u16,
        /// What follows has no meaning here.
        rest: Vec<u8>,
    }
}
