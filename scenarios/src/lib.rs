//! Worlds for drones: scenario files and the engines that run them.

pub mod report;
