//! Boards outside of this process, as the page shows them.

use minijinja::{Value, context};

use wheeleg_protocol::NODE_NAMES;

use wheeleg_remote_host::{BoardFigures, PilSummary};

/// A count with a thin space between groups of three digits; a dash for what was
/// not measured.
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{2009}');
        }
        out.push(digit);
    }
    out
}

fn measured(count: Option<u32>) -> String {
    count.map_or("–".to_owned(), |count| grouped(count.into()))
}

fn row(name: &str, kind: &str, board: Option<&BoardFigures>) -> Value {
    let Some(board) = board else {
        return context! { node => name, kind => kind, host => "this program, natively" };
    };
    context! {
        node => name,
        kind => kind,
        host => &*board.host,
        image => &*board.image,
        digest => if board.digest.bytes().all(|b| b == b'0') { "–" } else { &*board.digest },
        bits => grouped(board.compared_bits),
        differing => grouped(board.differing_bits),
        equal => board.compared_bits > 0 && board.differing_bits == 0,
        median => measured(board.tick_instructions_median),
        worst => measured(board.tick_instructions_worst),
        stack => measured(board.stack_used_bytes),
        room => measured(board.stack_size_bytes),
        resets => board.resets,
    }
}

/// What the template needs of the comparison.
pub(super) fn context(pil: &PilSummary) -> Value {
    let nodes: Vec<Value> = NODE_NAMES
        .iter()
        .zip(&pil.nodes)
        .map(|(name, kind)| {
            let board = pil.boards.iter().find(|board| board.node == *name);
            row(name, kind, board)
        })
        .collect();
    let channels: Vec<Value> = pil
        .channels
        .iter()
        .map(|c| {
            context! {
                name => c.channel,
                bits => grouped(c.compared_bits),
                differing => grouped(c.differing_bits),
                equal => c.differing_bits == 0,
            }
        })
        .collect();
    context! {
        nodes => nodes,
        channels => channels,
        bits => grouped(pil.compared_bits),
        differing => grouped(pil.differing_bits),
        // Nothing compared is nothing shown.
        equal => pil.compared_bits > 0 && pil.differing_bits == 0,
        ticks => grouped(pil.compared_ticks),
        frames => grouped(pil.compared_frames),
        first => &pil.first_difference,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_grouped_and_what_is_not_measured_is_a_dash() {
        assert_eq!(grouped(0), "0");
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(8_123_456), "8\u{2009}123\u{2009}456");
        assert_eq!(measured(None), "–");
        assert_eq!(measured(Some(1500)), "1\u{2009}500");
    }
}
