//! Single faces in single precision against the f64 edge integrals.

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::DVec3;
use num_complex::Complex64;

use super::near::{Query, add_face};
use super::packet::Packet;
use super::{LANES, PacketDensity, Points};
use crate::DensityKernel;
use crate::bvh::Bvh;
use crate::density::edge_integral::EdgeQuadrature;
use crate::kernel::CumulativeKernel;
use crate::shapes::PegInHole;

#[simd]
fn triangle<S: Simd>(
    simd: S,
    density: &PacketDensity<'_>,
    points: &Points,
    xi: f32,
    index: usize,
) -> [f32; 2] {
    let packet = Packet::new(simd, points);
    let xi = f32x16::splat(simd, xi);
    let reach = xi * (1.0 + density.kernel.reach * density.kernel.sigma);
    let query = Query {
        xi,
        inverse: 1.0 / xi,
        reach_squared: reach * reach,
    };
    let mut sum = [packet.splat(0.0); 2];
    add_face(density, &packet, &query, index, &mut sum);
    [sum[0][0], sum[1][0]]
}

#[test]
fn triangles_match_the_f64_edge_integrals() {
    let (_, peg) = PegInHole::Combined.pair(0.0).unwrap();
    let bvh = Bvh::build(&peg);
    // Lattice points: feet of perpendiculars fall close to many edges of a facetted cylinder,
    // where numerator and denominator of the edge integrand nearly vanish together.
    let places = (0..216).map(|i| DVec3::new((i / 36) as f64, (i / 6 % 6) as f64, (i % 6) as f64));
    let points: Vec<DVec3> = places.map(|p| (p - 2.5) * (1.0 / 2.05)).collect();
    for sigma in [0.05, 0.2] {
        let kernel = DensityKernel::new(sigma).unwrap();
        let density = PacketDensity::new(&bvh, &kernel, 1e-5);
        let table = CumulativeKernel::new(kernel);
        let exact = EdgeQuadrature::new(sigma, 8.4, 12, 0.25);
        for q in &points {
            let xi = bvh.nearest_normalized(*q).1.sqrt();
            for (i, t) in bvh.faces.iter().enumerate() {
                let expected = exact.face(&table, t, *q, xi);
                let [re, im] = dispatch!(Level::new(), simd => {
                    triangle(simd, &density, &[*q; LANES], xi as f32, i)
                });
                let error = (Complex64::new(re.into(), im.into()) - expected).norm();
                // Of densities near 1, at the setting for 1e-5.
                assert!(error < 1e-5, "{sigma} {q} triangle {i}: {error:e}");
            }
        }
    }
}
