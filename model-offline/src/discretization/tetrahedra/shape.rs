//! Shape functions of the reference tetrahedron, linear and quadratic, and rules that integrate over it.
//!
//! Barycentric coordinates l₀ … l₃; the middle node of edge (a, b) has `4 l_a l_b`, corner a `l_a (2 l_a − 1)`.

use super::geometry::EDGES;

/// Values of the ten quadratic shape functions: corners, then middles of [`EDGES`].
pub fn quadratic_values(l: &[f64; 4]) -> [f64; 10] {
    std::array::from_fn(|i| match i.checked_sub(4) {
        None => l[i] * (2.0 * l[i] - 1.0),
        Some(e) => 4.0 * l[EDGES[e][0]] * l[EDGES[e][1]],
    })
}

/// Their derivatives with respect to the four barycentric coordinates, taken as independent.
pub fn quadratic_slopes(l: &[f64; 4]) -> [[f64; 4]; 10] {
    std::array::from_fn(|i| {
        let mut slope = [0.0; 4];
        match i.checked_sub(4) {
            None => slope[i] = 4.0 * l[i] - 1.0,
            Some(e) => {
                let [a, b] = EDGES[e];
                slope[a] = 4.0 * l[b];
                slope[b] = 4.0 * l[a];
            }
        }
        slope
    })
}

/// A point of an integration rule: barycentric coordinates and share of the volume.
pub type RulePoint = ([f64; 4], f64);

/// Four points, exact for quadratic polynomials: for the energy of a straight quadratic tetrahedron with a linear law.
pub fn four_points() -> Vec<RulePoint> {
    const FAR: f64 = 0.585_410_196_624_968_5;
    const NEAR: f64 = 0.138_196_601_125_010_5;
    (0..4).map(|k| (std::array::from_fn(|i| if i == k { FAR } else { NEAR }), 0.25)).collect()
}

/// Fourteen points, exact for polynomials of degree 5, all weights positive (Walkington 2000): for elements whose edges
/// are bent, or whose middle nodes are not in the middle.
pub fn fourteen_points() -> Vec<RulePoint> {
    const CORNERS: [(f64, f64); 2] =
        [(0.310_885_919_263_300_6, 0.112_687_925_718_015_85), (0.092_735_250_310_891_23, 0.073_493_043_116_361_95)];
    const ON_EDGES: (f64, f64) = (0.045_503_704_125_649_65, 0.042_546_020_777_081_466);
    let at_corners = CORNERS.into_iter().flat_map(|(near, weight)| {
        (0..4).map(move |k| (std::array::from_fn(|i| if i == k { 1.0 - 3.0 * near } else { near }), weight))
    });
    let (near, weight) = ON_EDGES;
    let on_edges = EDGES
        .into_iter()
        .map(move |[a, b]| (std::array::from_fn(|i| if i == a || i == b { near } else { 0.5 - near }), weight));
    at_corners.chain(on_edges).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ∫ l₀^a l₁^b l₂^c l₃^d over a tetrahedron, over its volume: 3! a! b! c! d! / (a + b + c + d + 3)!.
    fn exact(powers: [u32; 4]) -> f64 {
        let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
        6.0 * powers.into_iter().map(factorial).product::<f64>() / factorial(powers.into_iter().sum::<u32>() + 3)
    }

    fn error(rule: &[RulePoint], powers: [u32; 4]) -> f64 {
        let term = |(l, w): &RulePoint| w * (0..4).map(|i| l[i].powi(powers[i] as i32)).product::<f64>();
        (rule.iter().map(term).sum::<f64>() - exact(powers)).abs()
    }

    #[test]
    fn rules_are_exact_to_their_degree_and_no_further() {
        for (rule, degree) in [(four_points(), 2), (fourteen_points(), 5)] {
            for a in 0..=degree + 1 {
                for b in 0..=degree + 1 - a {
                    for c in 0..=degree + 1 - a - b {
                        let total = a + b + c;
                        if total <= degree {
                            assert!(error(&rule, [a, b, c, 0]) < 1e-14, "{degree}: {a} {b} {c}");
                        }
                    }
                }
            }
            assert!(error(&rule, [degree + 1, 0, 0, 0]) > 1e-6);
        }
    }

    #[test]
    fn quadratic_shape_functions_are_one_at_their_own_node_and_sum_to_one() {
        let node = |i: usize| -> [f64; 4] {
            std::array::from_fn(|k| match i.checked_sub(4) {
                None => f64::from(u8::from(k == i)),
                Some(e) => {
                    if EDGES[e].contains(&k) {
                        0.5
                    } else {
                        0.0
                    }
                }
            })
        };
        for i in 0..10 {
            let values = quadratic_values(&node(i));
            assert!((0..10).all(|j| (values[j] - f64::from(u8::from(i == j))).abs() < 1e-15));
        }
        let l = [0.1, 0.2, 0.3, 0.4];
        assert!((quadratic_values(&l).iter().sum::<f64>() - 1.0).abs() < 1e-15);
        for (k, step) in [1e-6_f64; 4].into_iter().enumerate() {
            let moved = |s: f64| quadratic_values(&std::array::from_fn(|i| if i == k { l[i] + s } else { l[i] }));
            let (up, down, slopes) = (moved(step), moved(-step), quadratic_slopes(&l));
            assert!((0..10).all(|i| ((up[i] - down[i]) / (2.0 * step) - slopes[i][k]).abs() < 1e-9));
        }
    }
}
