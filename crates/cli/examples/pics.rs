use ndarray::Array2;
use pegfit::picture::*;
fn main() {
    let n = 200;
    let sd = Array2::from_shape_fn((n, n), |(i, j)| {
        let x = i as f32 / 10. - 10.;
        let y = j as f32 / 10. - 10.;
        (x * x + y * y).sqrt() - 6.0
    });
    let v = sd.mapv(|d| {
        if d < 0. {
            -(1.0 / (1.0 + d * d * 0.2))
        } else {
            1.0 / (1.0 + d * d * 0.5)
        }
    });
    let hm = HeatMap {
        title: "Density of the peg, imaginary part, y = 0 mm".into(),
        horizontal: "x (mm)".into(),
        vertical: "z (mm)".into(),
        values: v.clone(),
        across: [-10., 9.9],
        up: [-10., 9.9],
        scale: ColourScale::diverging(v.iter().map(|x| *x as f64), 0.99),
        legend: "Im rho\n(dimensionless)".into(),
        contours: Some(Contours {
            values: sd.clone(),
            levels: heat_map::distance_levels(&sd, 8),
            bold: vec![0.0],
            label: "lines: signed distance, every 2 mm; bold: the boundary".into(),
        }),
        equal_axes: true,
    };
    let bytes = png("t", (1000, 860), |s| hm.draw(s)).unwrap();
    std::fs::write("/tmp/hm.png", bytes).unwrap();
    let lc = LineChart {
        title: "Energy along x".into(),
        horizontal: "x (mm)".into(),
        vertical: "energy (mJ)".into(),
        series: vec![
            Series {
                label: "direct".into(),
                points: (0..200)
                    .map(|i| {
                        let x = i as f64 / 10. - 10.;
                        (x, x.abs() * 3. - 10.)
                    })
                    .collect(),
                ..Default::default()
            },
            Series {
                label: "table".into(),
                points: (0..200)
                    .map(|i| {
                        let x = i as f64 / 10. - 10.;
                        (x, (x * x * 0.2) - 9.)
                    })
                    .collect(),
                dashed: true,
                ..Default::default()
            },
        ],
        marks: vec![Mark {
            at: 2.0,
            label: "contact".into(),
        }],
        floor: None,
    };
    let bytes = png("t", (1200, 700), |s| lc.draw(s)).unwrap();
    std::fs::write("/tmp/lc.png", bytes).unwrap();
    let sf = Surface {
        title: "Score".into(),
        first: "x (mm)".into(),
        second: "z (mm)".into(),
        height: "score (mm³)".into(),
        values: Array2::from_shape_fn((61, 61), |(i, j)| {
            let x = (i as f32 - 30.) / 8.;
            let y = (j as f32 - 30.) / 8.;
            100. * (-(x * x + y * y)).exp() - 20. * (-(x * x + y * y) / 6.).exp()
        }),
        first_range: [-10., 10.],
        second_range: [-10., 10.],
    };
    let bytes = png("t", (1200, 900), |s| sf.draw(s)).unwrap();
    std::fs::write("/tmp/sf.png", bytes).unwrap();
}
