//! CSV files from a recording: one per channel, units in the header.

use std::path::Path;

use super::recorder::{Recording, Row};
use super::registry::Sample;
use crate::{Event, EventSample, LogError};

/// Writes `joint-1.csv` … `events.csv` into `folder`, which must exist. The
/// fast channels are thinned to `rate_hz` (must divide 1000); pass 1000 for
/// every sample.
///
/// # Errors
/// [`LogError::Output`] if a file cannot be written.
pub fn write_csv(folder: &Path, recording: &Recording, rate_hz: u32) -> Result<(), LogError> {
    let period_ns = 1_000_000_000 / u64::from(rate_hz.max(1));
    for (i, rows) in recording.joints.iter().enumerate() {
        table(folder, &format!("joint-{}", i + 1), rows, period_ns)?;
    }
    for (i, rows) in recording.wheels.iter().enumerate() {
        table(folder, &format!("wheel-{}", i + 7), rows, period_ns)?;
    }
    table(folder, "foot-left", &recording.feet[0], period_ns)?;
    table(folder, "foot-right", &recording.feet[1], period_ns)?;
    table(folder, "body", &recording.body, period_ns)?;
    table(folder, "bus", &recording.bus, period_ns)?;
    table(folder, "supply", &recording.supply, period_ns)?;
    table(folder, "master", &recording.master, period_ns)?;
    for (i, rows) in recording.links.iter().enumerate() {
        table(folder, &format!("link-{}", i + 1), rows, 0)?;
    }
    let events: Vec<_> = recording.events.iter().map(sample_of).collect();
    table(folder, "events", &events, 0)
}

fn sample_of(row: &Row<Event>) -> Row<EventSample> {
    Row {
        t_ns: row.t_ns,
        v: row.v.sample(),
    }
}

fn table<S: Sample>(
    folder: &Path,
    name: &str,
    rows: &[Row<S>],
    period_ns: u64,
) -> Result<(), LogError> {
    let path = folder.join(format!("{name}.csv"));
    let failed = |e: csv::Error| LogError::output("write the table", &path, e.into());
    let mut out = csv::Writer::from_path(&path).map_err(failed)?;
    let mut header = vec!["time [s]".to_owned()];
    header.extend(S::FIELDS.iter().map(|f| format!("{} [{}]", f.name, f.unit)));
    out.write_record(&header).map_err(failed)?;
    let mut next_ns = 0;
    let mut record = csv::ByteRecord::new();
    let mut time = Vec::new();
    for row in rows {
        if row.t_ns < next_ns {
            continue;
        }
        // A period of zero keeps every row.
        let tick = row.t_ns.checked_div(period_ns);
        next_ns = tick.map_or(0, |n| (n + 1) * period_ns);
        record.clear();
        time.clear();
        super::push_fixed(&mut time, row.t_s(), 6);
        record.push_field(&time);
        row.v.cells(&mut |cell| {
            // Text arrives as JSON; CSV has its own quoting.
            match cell.first() {
                Some(b'"') => {
                    let text = serde_json::from_slice::<String>(cell).unwrap_or_default();
                    record.push_field(text.as_bytes());
                }
                Some(b'n') => record.push_field(b""),
                _ => record.push_field(cell),
            }
        });
        out.write_byte_record(&record).map_err(failed)?;
    }
    out.flush()
        .map_err(|e| LogError::output("write the table", &path, e))
}
