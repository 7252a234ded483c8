//! An axis-parallel ellipsoid in the coordinates that are not frozen.

/// An axis-parallel ellipsoid in the coordinates that are not frozen.
#[derive(Clone, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Centre; also the value of the frozen coordinates.
    pub center: Vec<f32>,
    /// Half of the axis along each coordinate, in its unit; 0 freezes the coordinate.
    pub half_axes: Vec<f32>,
}

impl Ellipsoid {
    /// Whether each coordinate varies.
    pub fn varies(&self) -> Vec<bool> {
        self.half_axes.iter().map(|half| *half > 0.0).collect()
    }

    /// How often the ellipsoid has to be enlarged to reach `x` in the coordinates that vary: 1 on its
    /// surface.
    pub fn gauge(&self, x: &[f32]) -> f64 {
        let offset = |i: usize| f64::from(x[i]) - f64::from(self.center[i]);
        let varying = (0..x.len()).filter(|&i| self.half_axes[i] > 0.0);
        varying.map(|i| (offset(i) / f64::from(self.half_axes[i])).powi(2)).sum::<f64>().sqrt()
    }

    /// Whether `x` lies in the ellipsoid, its frozen coordinates equal to the centre's.
    pub fn contains(&self, x: &[f32]) -> bool {
        let frozen = (0..x.len()).all(|i| self.half_axes[i] > 0.0 || x[i] == self.center[i]);
        frozen && self.gauge(x) <= 1.0
    }
}

#[cfg(test)]
mod tests {
    use crate::rollout::{Ball, Ellipsoid, Purpose, Region, Stream};

    fn ellipsoid() -> Ellipsoid {
        Ellipsoid { center: vec![1.0, -2.0, 0.5], half_axes: vec![0.5, 0.0, 2.0] }
    }

    #[test]
    fn samples_lie_inside_and_fill_it_as_its_moments_say() {
        let (set, count) = (ellipsoid(), 20_000);
        let region = Region::Ellipsoid(set.clone());
        let stream = Stream::new(3, Purpose::USER, 0);
        let (mut squares, mut inner) = ([0.0; 3], 0);
        for index in 0..count {
            let x = region.point(stream, index);
            // In f32 a sample at the surface may lie an ulp outside.
            assert!(set.gauge(&x) <= 1.0 + 1e-6 && x[1] == -2.0, "{x:?}");
            inner += u64::from(set.gauge(&x) <= 0.5);
            for (i, square) in squares.iter_mut().enumerate() {
                *square += f64::from(x[i] - set.center[i]).powi(2);
            }
        }
        // In two dimensions a coordinate has the second moment h^2 / 4, and half the gauge a quarter
        // of the area; four standard errors.
        for (square, half) in [(squares[0], 0.5), (squares[2], 2.0_f64)] {
            let moment = square / count as f64 / (half * half);
            assert!((moment - 0.25).abs() < 4.0 * 0.217 / (count as f64).sqrt(), "{moment}");
        }
        let share = inner as f64 / count as f64;
        assert!((share - 0.25).abs() < 4.0 * (0.1875 / count as f64).sqrt(), "{share}");
    }

    #[test]
    fn equal_axes_are_a_ball_to_the_bit() {
        let (center, varies) = (vec![0.3, -0.7, 2.0], vec![true, false, true]);
        let ball = Region::Ball(Ball { center: center.clone(), radius: 0.4, varies });
        let round = Region::Ellipsoid(Ellipsoid { center, half_axes: vec![0.4, 0.0, 0.4] });
        let stream = Stream::new(9, Purpose::USER, 1);
        for index in 0..200 {
            let x = ball.point(stream, index);
            assert_eq!(x, round.point(stream, index));
            assert!(!round.contains(&[x[0], x[1] + 1.0, x[2]]));
        }
        assert!((ball.volume() - round.volume()).abs() < 1e-12 * ball.volume());
        assert_eq!(ball.varies(), round.varies());
    }

    #[test]
    fn the_surface_and_frozen_coordinates_decide_membership() {
        let region = Region::Ellipsoid(ellipsoid());
        for (x, inside) in [
            ([1.0, -2.0, 2.5], true),
            ([1.0, -2.0, 2.5001], false),
            ([1.5, -2.0, 0.5], true),
            ([1.4, -2.0, 2.0], false),
            ([1.0, -2.1, 0.5], false),
        ] {
            assert_eq!(region.contains(&x), inside, "{x:?}");
        }
        let area = std::f64::consts::PI * 0.5 * 2.0;
        assert!((region.volume() - area).abs() < 1e-12, "{}", region.volume());
    }
}
