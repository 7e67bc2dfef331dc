//! Particles as a structure of arrays, in cells of the map from its lower left corner.

use std::f32::consts::TAU;

use super::fast::{ROUND, sin_cos};

/// Hypotheses of the drone's pose.
#[derive(Debug, Clone, Default)]
pub(super) struct Particles {
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    /// Radians counter-clockwise from the grid's rows.
    pub(super) heading: Vec<f32>,
    pub(super) sin: Vec<f32>,
    pub(super) cos: Vec<f32>,
}

impl Particles {
    /// A single one: cells, cells and radians.
    pub(super) fn one((x, y, heading): (f32, f32, f32)) -> Self {
        let mut particle = Self::default();
        particle.push(x, y, heading);
        particle.turn();
        particle
    }

    pub(super) fn len(&self) -> usize {
        self.x.len()
    }

    pub(super) fn clear(&mut self) {
        self.x.clear();
        self.y.clear();
        self.heading.clear();
    }

    pub(super) fn push(&mut self, x: f32, y: f32, heading: f32) {
        self.x.push(x);
        self.y.push(y);
        self.heading.push(heading);
    }

    /// Appends one of other particles.
    pub(super) fn copy(&mut self, from: &Self, index: usize) {
        let (x, y, heading) = from.at(index);
        self.push(x, y, heading);
    }

    /// Cells, cells and radians.
    pub(super) fn at(&self, index: usize) -> (f32, f32, f32) {
        (self.x[index], self.y[index], self.heading[index])
    }

    /// Wraps all headings and sets their sines and cosines.
    pub(super) fn turn(&mut self) {
        self.sin.resize(self.heading.len(), 0.0);
        self.cos.resize(self.heading.len(), 0.0);
        let headings = self.heading.iter_mut();
        for ((heading, sin), cos) in headings.zip(&mut self.sin).zip(&mut self.cos) {
            *heading = wrapped(*heading);
            (*sin, *cos) = sin_cos(*heading);
        }
    }

    /// The particles from `from` to `to`.
    pub(super) fn part(&self, from: usize, to: usize) -> Poses<'_> {
        Poses {
            x: &self.x[from..to],
            y: &self.y[from..to],
            heading: &self.heading[from..to],
            sin: &self.sin[from..to],
            cos: &self.cos[from..to],
        }
    }
}

/// The same angle in half a turn to either side.
#[inline]
pub(super) fn wrapped(angle: f32) -> f32 {
    angle - TAU * ((angle * (1.0 / TAU) + ROUND) - ROUND)
}

/// Some particles; all slices are equally long.
#[derive(Clone, Copy)]
pub(super) struct Poses<'a> {
    pub(super) x: &'a [f32],
    pub(super) y: &'a [f32],
    pub(super) heading: &'a [f32],
    pub(super) sin: &'a [f32],
    pub(super) cos: &'a [f32],
}

impl Poses<'_> {
    /// Calls `at` with the place of a point of the body frame for each particle, and writes what it returns.
    #[inline]
    pub(super) fn place(
        self,
        (ahead, left): (f32, f32),
        written: &mut [u32],
        at: impl Fn(f32, f32) -> u32,
    ) {
        let places = self.x.iter().zip(self.y).zip(self.sin.iter().zip(self.cos));
        for (written, ((x, y), (sin, cos))) in written.iter_mut().zip(places) {
            *written = at(x + cos * ahead - sin * left, y + sin * ahead + cos * left);
        }
    }
}
