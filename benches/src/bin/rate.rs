//! Times of a table in Rust, beside those of Python: `rate TABLE POSES`, where `POSES` holds rows of
//! seven doubles `x y z qx qy qz qw`. For every line `FIRST COUNT THREADS` of standard input, threads
//! `one` or `all`, answers with the seconds that these poses took; `benches/python/query.py` asks.

use std::io::{BufRead, Write};
use std::time::Instant;

use fft_correlate::{EnergyTable, Pose, Response, TableStore};
use glam::{DQuat, DVec3};
use pegfit_benches::Outcome;

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [table, poses] = words.as_slice() else {
        return Err("usage: rate TABLE POSES".into());
    };
    let table = TableStore::open(table.as_ref())?.load(u64::MAX)?;
    let poses = read(&std::fs::read(poses)?);
    let mut responses = vec![Response::default(); poses.len()];
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let seconds = answer(&line, &table, &poses, &mut responses)
            .ok_or_else(|| format!("expected FIRST COUNT one|all, found {line:?}"))?;
        println!("{seconds}");
        std::io::stdout().flush()?;
    }
    Ok(())
}

fn read(bytes: &[u8]) -> Vec<Pose> {
    let (numbers, _) = bytes.as_chunks();
    let numbers: Vec<f64> = numbers.iter().map(|b| f64::from_ne_bytes(*b)).collect();
    let (rows, _) = numbers.as_chunks();
    let pose = |&[x, y, z, qx, qy, qz, qw]: &[f64; 7]| {
        Pose::new(DQuat::from_xyzw(qx, qy, qz, qw), DVec3::new(x, y, z))
    };
    rows.iter().map(pose).collect()
}

/// Seconds; none if the line asks for nothing that there is.
fn answer(
    line: &str,
    table: &EnergyTable,
    poses: &[Pose],
    responses: &mut [Response],
) -> Option<f64> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let &[first, count, threads] = words.as_slice() else {
        return None;
    };
    let first: usize = first.parse().ok()?;
    let end = first.checked_add(count.parse().ok()?)?;
    let (poses, responses) = (poses.get(first..end)?, responses.get_mut(first..end)?);
    let began = Instant::now();
    match threads {
        "one" => table.respond_each(poses, responses),
        "all" => table.respond_many(poses, responses),
        _ => return None,
    }
    Some(began.elapsed().as_secs_f64())
}
