//! Weights from scores, so that enough particles survive.

use super::config::Config;
use super::fast::{exp, sum};

/// Steps of the search for a temper; each halves the interval.
const BISECTIONS: usize = 10;

/// Sets weights, which sum up to 1, to the exponentials of `temper` times the scores. Returns the effective number of
/// particles, 1 / Σw²: J. Liu, "Metropolized independent sampling", 1996.
pub(super) fn weigh(scores: &[f32], temper: f32, weights: &mut Vec<f32>) -> f32 {
    let best = scores.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    weights.resize(scores.len(), 0.0);
    for (weight, score) in weights.iter_mut().zip(scores) {
        *weight = exp(temper * (score - best));
    }
    let share = 1.0 / sum(weights.iter().copied());
    weights.iter_mut().for_each(|weight| *weight *= share);
    1.0 / sum(weights.iter().map(|weight| weight * weight))
}

/// Weighs with the greatest temper up to `temper_max` that leaves [`Config::SURVIVORS`] of all particles effective.
///
/// While the pose is not known, few particles happen to stand near the true one, and full weights would bet on the first of
/// them. Tempered, it takes some scans until one place has won. Source: P. Del Moral, A. Doucet, A. Jasra, "Sequential Monte
/// Carlo samplers", 2006.
pub(super) fn temper(scores: &[f32], temper_max: f32, weights: &mut Vec<f32>) {
    let survivors = Config::SURVIVORS * scores.len() as f32;
    if weigh(scores, temper_max, weights) >= survivors {
        return;
    }
    let (mut low, mut high) = (0.0, temper_max);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if weigh(scores, middle, weights) < survivors {
            high = middle;
        } else {
            low = middle;
        }
    }
    weigh(scores, low, weights);
}

/// Draws `count` particles by their weights: their indices, in rising order. O(n + count).
///
/// Source: low-variance sampling; S. Thrun, W. Burgard, D. Fox, *Probabilistic Robotics*, 2005, table 4.4.
pub(super) fn draw(weights: &[f32], count: usize, offset: f32, drawn: &mut Vec<u32>) {
    drawn.clear();
    let per_weight = count as f64;
    let mut reached = 0.0;
    for (index, weight) in weights.iter().enumerate() {
        reached += f64::from(*weight) * per_weight;
        while drawn.len() < count && drawn.len() as f64 + f64::from(offset) < reached {
            drawn.push(index as u32);
        }
    }
    // Weights may sum up to a little less than 1.
    drawn.resize(count, weights.len().saturating_sub(1) as u32);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effective(weights: &[f32]) -> f32 {
        1.0 / weights.iter().map(|it| it * it).sum::<f32>()
    }

    #[test]
    fn a_decisive_scan_leaves_a_tenth_of_the_particles_effective() {
        let scores: Vec<f32> = (0..1_000_u16).map(|index| -f32::from(index)).collect();
        let mut weights = Vec::new();
        temper(&scores, 1.0, &mut weights);
        assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-4);
        assert!((100.0..110.0).contains(&effective(&weights)));
        assert!(weights.is_sorted_by(|a, b| a >= b));
    }

    #[test]
    fn a_scan_that_tells_little_has_its_full_weight() {
        let scores = [0.0, -0.1, -0.2];
        let mut weights = Vec::new();
        temper(&scores, 1.0, &mut weights);
        assert!((weights[1] / weights[0] - libm::expf(-0.1)).abs() < 1e-5);
    }

    #[test]
    fn each_particle_is_drawn_as_often_as_its_weight_says_up_to_one() {
        let weights = [0.5, 0.0, 0.125, 0.375];
        let mut drawn = Vec::new();
        for offset in [0.0, 0.3, 0.99] {
            draw(&weights, 80, offset, &mut drawn);
            for (index, weight) in weights.iter().enumerate() {
                let times = drawn.iter().filter(|it| **it as usize == index).count() as f32;
                assert!((times - weight * 80.0).abs() <= 1.0);
            }
        }
    }
}
