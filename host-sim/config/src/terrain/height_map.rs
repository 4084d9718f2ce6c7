//! Height maps: tables of numbers (CSV) and grey pictures (PNG).

use std::io::Cursor;
use std::sync::Arc;

use wheeleg_plant::terrain::{HeightMap, HeightMapError, MOST_VALUES as MOST, STEEPEST_DEG, Shape};

use super::fields::{Fields, length};
use super::files::Files;
use crate::params::FieldSpec;
use crate::quantity::pretty;
use crate::reader::Reader;

/// Wrong cells of a file that are listed.
const LISTED: usize = 5;
/// Highest and lowest, m.
const HIGHEST_M: f64 = 1e4;

/// Values of a file, row after row from the top.
#[derive(Default)]
struct Values {
    values: Vec<f64>,
    columns: usize,
    /// Line of each row in a table; none of a picture.
    lines: Vec<usize>,
}

impl Values {
    /// Place of a row for a message: both numbers count from 1.
    fn row(&self, row: usize) -> String {
        match self.lines.get(row - 1) {
            Some(line) => format!("line {line}"),
            None => format!("row {row}"),
        }
    }
}

/// Reads a map.
pub(super) fn height_map(
    r: &mut Reader,
    fields: &mut Fields<'_>,
    files: &Files<'_>,
) -> Option<Vec<Shape>> {
    let cell = length("cell", [1e-3, 1e3], "distance between neighbouring values");
    let scale = length("scale", [-1e3, 1e3], "height of one unit of the file");
    let offset = length("offset", [-HIGHEST_M, HIGHEST_M], "added to every height");
    let origin = FieldSpec {
        doc: "x and y of the first value of the last row: the map's rear right corner",
        ..length("origin", [-1e5, 1e5], "")
    };
    fields.has("file");
    let name = r.text(fields.entry, "file");
    let is_picture = name.as_deref().is_some_and(is_picture);
    let cell = fields.required(r, &cell);
    let origin = fields.pair(r, &origin);
    let offset = fields.or(r, &offset, 0.0);
    // Numbers in a table are metres; those of a picture have no scale yet.
    let scale = if is_picture {
        fields.required(r, &scale)
    } else {
        fields.or(r, &scale, 1.0)
    };
    let name = name?;
    let (_, item) = fields.entry.get("file")?;
    let span = item.span();
    let path = fields.entry.field_path("file");
    let problem = |r: &mut Reader, what: &str, help: Option<String>| {
        let message = format!("`{path}` = \"{name}\": {what}");
        r.problem(span.clone(), message, "this file", help);
    };
    let bytes = match files.read(&name) {
        Ok(bytes) => bytes,
        Err(what) => {
            let help = "a path counts from the folder of the scenario's file";
            problem(r, &what, Some(help.into()));
            return None;
        }
    };
    let values = match is_picture {
        true => picture(&bytes).map_err(|what| vec![what]),
        false => table(&bytes),
    };
    let values = match values {
        Ok(values) => values,
        Err(wrong) => {
            let help = "a table has one row of the map in a line, its numbers parted by commas, \
                        semicolons or blanks; a picture is a grey PNG with 8 or 16 bits";
            for what in wrong {
                problem(r, &what, Some(help.into()));
            }
            return None;
        }
    };
    let (cell, origin, offset, scale) = (cell?, origin?, offset?, scale?);
    if scale == 0.0 {
        let span = fields.entry.get("scale").and_then(|(_, item)| item.span());
        let message = format!(
            "`{}` = 0 makes all heights of the map equal: allowed -1000 to 1000 m without 0",
            fields.entry.field_path("scale")
        );
        let help = "level ground is a part of its own: `kind = \"plane\"`";
        r.problem(span, message, "no heights", Some(help.into()));
        return None;
    }
    let heights: Vec<f64> = values.values.iter().map(|v| v * scale + offset).collect();
    if let Some(at) = heights.iter().position(|h| h.abs() > HIGHEST_M) {
        let what = format!(
            "{}, column {}: the height is {} m; allowed -{HIGHEST_M} to {HIGHEST_M} m",
            values.row(at / values.columns + 1),
            at % values.columns + 1,
            pretty(heights[at])
        );
        problem(r, &what, None);
        return None;
    }
    match HeightMap::new(&heights, values.columns, cell, origin) {
        Ok(map) => Some(vec![Shape::HeightMap(Arc::new(map))]),
        Err(error) => {
            let what = match error {
                HeightMapError::Steep {
                    row,
                    column,
                    next_row,
                    next_column,
                    rise_m,
                    slope_deg,
                } => format!(
                    "{}, column {column}: the height changes by {} m from here to its neighbour at {}, \
                     column {next_column}, {slope_deg:.1}°; allowed are {STEEPEST_DEG}°",
                    values.row(row),
                    pretty(rise_m),
                    values.row(next_row),
                ),
                size @ HeightMapError::Size { .. } => size.to_string(),
            };
            let help = "is `cell` right, and `scale`? A wall is a part of its own: `block`";
            problem(r, &what, Some(help.into()));
            None
        }
    }
}

fn is_picture(name: &str) -> bool {
    let extension = std::path::Path::new(name).extension();
    extension.is_some_and(|e| e.eq_ignore_ascii_case("png"))
}

/// Numbers separated by commas, semicolons or blanks; a `#` begins a comment.
///
/// # Errors
/// In words, with line and column: comments and empty lines count, as in an editor.
fn table(bytes: &[u8]) -> Result<Values, Vec<String>> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let line = bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n');
        vec![format!("line {}: not a text", line.count() + 1)]
    })?;
    let text = text.trim_start_matches('\u{feff}');
    let mut values = Values::default();
    let mut wrong = Vec::new();
    let mut has_semicolon = false;
    let mut has_comma = false;
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.split('#').next().unwrap_or("").trim();
        if line.is_empty() {
            continue;
        }
        has_semicolon |= line.contains(';');
        has_comma |= line.contains(',');
        if has_semicolon && has_comma {
            return Err(vec![decimal_comma(number, line)]);
        }
        values.lines.push(number);
        if values.lines.len() > MOST {
            wrong.push(format!("more than {MOST} rows; allowed are 2 to {MOST}"));
            break;
        }
        let parted = if line.contains([',', ';']) {
            line.split([',', ';']).map(str::trim).collect::<Vec<_>>()
        } else {
            line.split_whitespace().collect()
        };
        if values.lines.len() == 1 {
            values.columns = parted.len();
        } else if parted.len() != values.columns && wrong.len() < LISTED {
            wrong.push(format!(
                "line {number} has {} values, line {} has {}",
                parted.len(),
                values.lines[0],
                values.columns
            ));
        }
        for (column, cell) in (1..).zip(parted) {
            match cell.parse::<f64>() {
                Ok(value) if value.is_finite() => values.values.push(value),
                _ if wrong.len() < LISTED => wrong.push(format!(
                    "line {number}, column {column}: {} is not a finite number",
                    shortened(cell)
                )),
                _ => {}
            }
        }
    }
    if values.values.is_empty() && wrong.is_empty() {
        wrong.push("it holds no numbers".to_owned());
    }
    if wrong.is_empty() {
        Ok(values)
    } else {
        Err(wrong)
    }
}

/// Spreadsheets of many countries write decimal commas and separate the numbers by semicolons: each comma
/// would split a number in two.
fn decimal_comma(line: usize, text: &str) -> String {
    format!(
        "line {line}: a file with semicolons and commas has decimal commas; write numbers with a \
         decimal point, such as {}",
        shortened(&text.replace(',', "."))
    )
}

/// The beginning of a text, quoted.
fn shortened(text: &str) -> String {
    let begin: String = text.chars().take(20).collect();
    format!("{begin:?}")
}

/// Grey values of a picture.
///
/// # Errors
/// In words.
fn picture(bytes: &[u8]) -> Result<Values, String> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    // Grey values of fewer than eight bits come as eight.
    decoder.set_transformations(png::Transformations::IDENTITY);
    // The decoder's messages are for programmers.
    let no_picture = |e: png::DecodingError| match e {
        png::DecodingError::LimitsExceeded => "the picture is too large".to_owned(),
        _ => "it is not a complete PNG picture".to_owned(),
    };
    let mut reader = decoder.read_info().map_err(no_picture)?;
    let info = reader.info();
    let (wide, high) = (info.width as usize, info.height as usize);
    if info.color_type != png::ColorType::Grayscale {
        let found = match info.color_type {
            png::ColorType::Grayscale => "grey",
            png::ColorType::GrayscaleAlpha => "grey with transparency",
            png::ColorType::Rgb => "in colours",
            png::ColorType::Rgba => "in colours with transparency",
            png::ColorType::Indexed => "in the colours of a palette",
        };
        return Err(format!(
            "the picture is {found}; allowed is grey without transparency"
        ));
    }
    let bytes_each = match info.bit_depth {
        png::BitDepth::Eight => 1,
        png::BitDepth::Sixteen => 2,
        other => {
            return Err(format!(
                "{} bits a value; allowed are 8 and 16",
                other as u8
            ));
        }
    };
    if wide > MOST || high > MOST {
        return Err(format!(
            "{wide} columns and {high} rows; allowed are 2 to {MOST} of each"
        ));
    }
    let mut pixels = vec![0; wide * high * bytes_each];
    reader.next_frame(&mut pixels).map_err(no_picture)?;
    let values = pixels
        .chunks_exact(bytes_each)
        .map(|value| value.iter().fold(0.0, |sum, b| 256.0 * sum + f64::from(*b)));
    Ok(Values {
        values: values.collect(),
        columns: wide,
        lines: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_may_be_parted_as_people_part_them() {
        let read = |text: &str| table(text.as_bytes()).map(|v| (v.columns, v.values));
        let expected = Ok((3, vec![1.0, 2.0, 3.0, -4.5, 5e-1, 6.0]));
        assert_eq!(read("1,2,3\n-4.5,5e-1,6\n"), expected);
        assert_eq!(read("\u{feff}# m\r\n1; 2; 3\r\n\r\n-4.5; 0.5; 6"), expected);
        assert_eq!(read("1 2\t3\n-4.5  .5 6"), expected);
        let wrong = read("# heights, m\n1,x,3\n\n4,5\n# the last\n6,,nan\n").unwrap_err();
        assert_eq!(
            wrong,
            [
                "line 2, column 2: \"x\" is not a finite number",
                "line 4 has 2 values, line 2 has 3",
                "line 6, column 2: \"\" is not a finite number",
                "line 6, column 3: \"nan\" is not a finite number",
            ]
        );
        assert_eq!(read("# nothing\n").unwrap_err(), ["it holds no numbers"]);
        let comma = "a file with semicolons and commas has decimal commas";
        for (table, line, written) in [
            ("0,0;0,0;0,1\n0,0;0,2;0,1\n", "line 1: ", "\"0.0;0.0;0.1\""),
            ("0;0,0;0\n0;0;0\n", "line 1: ", "\"0;0.0;0\""),
            ("0;0\n# 1,5\n\n0,5;1\n", "line 4: ", "\"0.5;1\""),
            ("0;0\n0,5\n", "line 2: ", "\"0.5\""),
        ] {
            let told = read(table).unwrap_err();
            assert_eq!(told.len(), 1, "{told:?}");
            for part in [line, comma, written] {
                assert!(told[0].contains(part), "{part} in {told:?}");
            }
        }
        assert_eq!(
            table(b"1,2\n\xff,3").map(drop).unwrap_err(),
            ["line 2: not a text"]
        );
    }

    /// A picture of these grey values.
    fn grey(depth: png::BitDepth, color: png::ColorType, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
        encoder.set_depth(depth);
        encoder.set_color(color);
        let mut writer = encoder.write_header().expect("in memory");
        writer.write_image_data(data).expect("in memory");
        drop(writer);
        bytes
    }

    #[test]
    fn pictures_are_grey_with_8_or_16_bits() {
        use png::{BitDepth, ColorType};
        let eight = picture(&grey(
            BitDepth::Eight,
            ColorType::Grayscale,
            &[0, 1, 2, 255],
        ));
        assert_eq!(eight.expect("read").values, [0.0, 1.0, 2.0, 255.0]);
        let data = [0, 1, 1, 0, 255, 255, 0, 0];
        let sixteen = picture(&grey(BitDepth::Sixteen, ColorType::Grayscale, &data));
        assert_eq!(sixteen.expect("read").values, [1.0, 256.0, 65535.0, 0.0]);
        let colour = picture(&grey(BitDepth::Eight, ColorType::Rgb, &[0; 12]));
        let said = colour.map(drop).unwrap_err();
        assert!(
            said.contains("in colours") && said.contains("allowed is grey"),
            "{said}"
        );
        let mut broken = grey(BitDepth::Eight, ColorType::Grayscale, &[0; 4]);
        broken[12..16].copy_from_slice(&[0; 4]);
        for bytes in [&b"not a picture"[..], &broken, &broken[..20], &[]] {
            let said = picture(bytes).map(drop).unwrap_err();
            assert_eq!(said, "it is not a complete PNG picture");
        }
    }
}
