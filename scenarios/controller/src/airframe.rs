//! Parameters of the aircraft: mass, rotors, drag, battery.

use nalgebra::Vector3;

/// Standard gravity, in m/s² (CGPM 1901).
pub const GRAVITY_MPS2: f64 = 9.806_65;

/// A quadrotor with rotors at the corners of a rectangle (X frame), in its body's frame: forward, right, down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Airframe {
    /// Mass with battery, in kg.
    pub mass_kg: f64,
    /// Moments of inertia about the axes forward, right and down, in kg·m².
    pub inertia_kgm2: Vector3<f64>,
    /// Distance of the rotors before and behind the centre of mass, in metres.
    pub rotor_forward_m: f64,
    /// Distance of the rotors to the right and left of the centre of mass, in metres.
    pub rotor_right_m: f64,
    /// Drag of the turning rotors along the body's axes, in N/(m/s) for each rad/s of all four together.
    pub rotor_drag: Vector3<f64>,
    /// Drag of the frame along its axes, in N/(m/s)².
    pub frame_drag: Vector3<f64>,
    /// Motors and propellers.
    pub motor: Motor,
    /// Battery.
    pub battery: Pack,
}

/// Motor, propeller and ESC.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motor {
    /// Thrust for the square of speed, in N/(rad/s)².
    pub thrust_coefficient: f64,
    /// Torque for thrust, in metres.
    pub torque_ratio_m: f64,
    /// Speed without load for voltage, in rad/s/V.
    pub speed_constant: f64,
    /// Speed at full throttle and `full_v`, in rad/s.
    pub full_speed_rad_s: f64,
    /// Voltage of the above.
    pub full_v: f64,
    /// Time constant of the speed's first-order lag, in seconds.
    pub lag_s: f64,
    /// Moment of inertia of propeller and rotor about their axis, in kg·m². The body turns the other way when they speed up.
    pub inertia_kgm2: f64,
}

/// Lithium-polymer battery.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pack {
    /// Cells in series.
    pub cells: u8,
    /// Charge of a full battery, in mAh.
    pub capacity_mah: f64,
    /// Charge at the start, as a fraction of a full one.
    pub charge: f64,
    /// Internal resistance of all cells with leads, in ohms.
    pub resistance_ohm: f64,
    /// Current of the electronics, in amperes.
    pub electronics_a: f64,
}

impl Airframe {
    /// A quadrotor with 5-inch propellers and four cells that hovers at 28 % of its throttle range.
    ///
    /// Mass, inertia, rotor positions, thrust, torque and lag: Agilicious (Foehn et al., Science Robotics 7(67), 2022), as
    /// RotorPy lists them. Rotor drag: 0.544 and 0.386 N/(m/s)/kg at hover (Faessler, Franchi and Scaramuzza, RA-L 3(2),
    /// 2018); along the axis, thrust ends at 1.2 times the pitch speed of a propeller with 4.3 inches of pitch. Assumed: drag
    /// of the frame (RotorPy's figures, which it doesn't source), a 2,400 kV motor, a battery of 1,800 mAh with 3 mΩ a cell, a
    /// propeller of 4.5 g as a rod and a bell of 15 g with a radius of 12.5 mm as a ring.
    #[must_use]
    pub fn agilicious() -> Self {
        Self {
            mass_kg: 0.752,
            inertia_kgm2: Vector3::new(2.5e-3, 2.1e-3, 4.3e-3),
            rotor_forward_m: 0.075,
            rotor_right_m: 0.10,
            rotor_drag: Vector3::new(9.4e-5, 6.7e-5, 7.5e-5),
            frame_drag: Vector3::new(5e-3, 5e-3, 1e-2),
            motor: Motor {
                thrust_coefficient: 1.562_522e-6,
                torque_ratio_m: 0.022,
                speed_constant: 251.3,
                full_speed_rad_s: 2_800.0,
                full_v: 16.8,
                lag_s: 0.033,
                inertia_kgm2: 8.4e-6,
            },
            battery: Pack {
                cells: 4,
                capacity_mah: 1_800.0,
                charge: 1.0,
                resistance_ohm: 0.012,
                electronics_a: 0.4,
            },
        }
    }

    /// Speed of each rotor at hover, in rad/s.
    #[must_use]
    pub fn hover_speed_rad_s(&self) -> f64 {
        libm::sqrt(self.mass_kg * GRAVITY_MPS2 / 4.0 / self.motor.thrust_coefficient)
    }

    /// Current of the full battery at hover, in amperes.
    #[must_use]
    pub fn hover_a(&self) -> f64 {
        let speed_rad_s = self.hover_speed_rad_s();
        let duty = self.motor.duty(speed_rad_s, self.motor.full_v);
        4.0 * self.motor.battery_a(speed_rad_s, duty) + self.battery.electronics_a
    }
}

impl Motor {
    /// Duty cycle from 0 to 1 that keeps a speed in rad/s, at a battery voltage: the inverse of
    /// [`Motor::steady_speed_rad_s`].
    #[must_use]
    pub fn duty(&self, speed_rad_s: f64, volts: f64) -> f64 {
        let linear = 1.0 / self.speed_constant;
        let square = (self.full_v - linear * self.full_speed_rad_s)
            / (self.full_speed_rad_s * self.full_speed_rad_s);
        (linear * speed_rad_s + square * speed_rad_s * speed_rad_s) / volts
    }

    /// Speed at rest of the lag, for a duty cycle from 0 to 1 at a battery voltage, in rad/s.
    ///
    /// The voltage is the speed's share and the drop that the propeller's torque causes: duty · V = speed / kV + r · speed²,
    /// with r from the speed at full throttle.
    #[must_use]
    #[inline]
    pub fn steady_speed_rad_s(&self, duty: f64, volts: f64) -> f64 {
        let linear = 1.0 / self.speed_constant;
        let square = (self.full_v - linear * self.full_speed_rad_s)
            / (self.full_speed_rad_s * self.full_speed_rad_s);
        let driven = (duty * volts).max(0.0);
        (libm::sqrt(linear * linear + 4.0 * square * driven) - linear) / (2.0 * square)
    }

    /// Thrust at a speed, in newtons.
    #[must_use]
    #[inline]
    pub fn thrust_n(&self, speed_rad_s: f64) -> f64 {
        self.thrust_coefficient * speed_rad_s * speed_rad_s
    }

    /// Current that the ESC draws from the battery for the propeller's torque, in amperes.
    #[must_use]
    #[inline]
    pub fn battery_a(&self, speed_rad_s: f64, duty: f64) -> f64 {
        let torque_nm = self.torque_ratio_m * self.thrust_n(speed_rad_s);
        torque_nm * self.speed_constant * duty
    }
}
