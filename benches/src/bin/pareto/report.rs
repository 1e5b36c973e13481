//! The table on the screen, the CSV file and the chart.

use pegfit_benches::frontier::{Kind, ParetoPanel, draw, frontier};
use pegfit_benches::{Arguments, Outcome};

use crate::Measured;

const COLUMNS: [&str; 6] = [
    "energy_random",
    "force_random",
    "torque_random",
    "energy_contact",
    "force_contact",
    "torque_contact",
];

pub(crate) fn publish(found: &[Measured], arguments: &Arguments) -> Outcome<()> {
    let points = |cost: fn(&Measured) -> f64| -> Vec<(f64, f64)> {
        found.iter().map(|m| (cost(m), m.wrench())).collect()
    };
    let by_time = frontier(&points(|m| m.query));
    let by_memory = frontier(&points(|m| m.bytes as f64));
    let mut csv = csv::Writer::from_path(arguments.out.join("pareto.csv"))?;
    let names = [
        "kind",
        "spacing_mm",
        "sampling",
        "step_deg",
        "numbers",
        "interpolation",
        "bake_cpu_s",
        "query_s",
        "bytes",
        "wrench_error",
        "on_time_frontier",
        "on_memory_frontier",
    ];
    csv.write_record(names.iter().chain(&COLUMNS))?;
    println!(
        "\n{:<20}{:<17}{:>6}{:>6}  {:<23}{:>8}{:>10}{:>9}  wrench   error, random: E, F, T; in contact: E, F, T (%)",
        "", "", "h, mm", "step", "numbers", "bake, s", "query, µs", "MiB"
    );
    for (index, m) in found.iter().enumerate() {
        let (time, memory) = (by_time.contains(&index), by_memory.contains(&index));
        let mark = |on: bool, c| if on { c } else { ' ' };
        let [mm, scheme, step, numbers, how] = &m.setting;
        print!(
            "{:<20}{scheme:<17}{mm:>6}{step:>6}  {numbers:<23}{:>8.2}{:>10.2}{:>9.3}{:>8.1} {}{}",
            m.kind,
            m.bake,
            1e6 * m.query,
            m.bytes as f64 / f64::from(1 << 20),
            100.0 * m.wrench(),
            mark(time, 't'),
            mark(memory, 'm'),
        );
        let errors = m.errors.iter().flatten();
        errors.clone().for_each(|e| print!("{:>8.2}", 100.0 * e));
        println!();
        let mut record: Vec<String> = [&m.kind, mm, scheme, step, numbers, how]
            .map(String::clone)
            .to_vec();
        record.extend([m.bake, m.query, m.bytes as f64, m.wrench()].map(|v| v.to_string()));
        record.extend([time, memory].map(|v| v.to_string()));
        record.extend(errors.map(f64::to_string));
        csv.write_record(record)?;
    }
    csv.flush()?;
    println!(
        "t, m: on the frontier of wrench error (rms of the four of force and torque) and time, memory"
    );
    let panel = |title: &str, cost: &str, of: fn(&Measured) -> f64| {
        let mut kinds: Vec<Kind> = Vec::new();
        for m in found {
            let point = (of(m), m.wrench());
            match kinds.iter_mut().find(|k| k.label == m.kind) {
                Some(kind) => kind.points.push(point),
                None => kinds.push(Kind {
                    label: m.kind.clone(),
                    points: vec![point],
                }),
            }
        }
        ParetoPanel {
            title: title.into(),
            cost: cost.into(),
            error: "the wrench error".into(),
            kinds,
        }
    };
    let panels = [
        panel(
            "Error of the wrench against time of a query",
            "seconds",
            |m| m.query,
        ),
        panel("Error of the wrench against memory", "bytes", |m| {
            m.bytes as f64
        }),
    ];
    draw(&panels, &arguments.out.join("pareto.png"))
}
