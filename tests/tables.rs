//! Tables of states as people write them: read as meant, or refused by the name of what is wrong.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;

use npyz::WriterBuilder;
use proptest::prelude::*;
use reachcast::files::StateReader;

const NAMES: [&str; 3] = ["x", "y", "heading"];

/// What is read from a file `name` with this content, or why not.
fn read(name: &str, content: &[u8]) -> Result<Vec<[f32; 3]>, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, content).unwrap();
    let reader = StateReader::<3>::open(&path, NAMES.map(str::to_owned));
    reader.and_then(StateReader::rest).map_err(|error| error.to_string())
}

fn csv(text: &str) -> Result<Vec<[f32; 3]>, String> {
    read("states.csv", text.as_bytes())
}

const ROWS: [[f32; 3]; 2] = [[0.5, -1.0, 2.25], [1e-3, 4.0, -0.125]];

#[test]
fn what_spreadsheets_and_libraries_write_is_read() {
    for text in [
        "0.5,-1,2.25\n1e-3,4,-0.125\n",
        "x,y,heading\n0.5,-1,2.25\n1e-3,4,-0.125",
        "# x,y,heading\n0.5,-1,2.25\n1e-3,4,-0.125\n",
        "#x, y, heading\r\n0.5, -1, 2.25\r\n1e-3, 4, -0.125\r\n",
        "\u{feff}x,y,heading\n0.5,-1,2.25\n1e-3,4,-0.125\n",
        "heading,x,y\n2.25,0.5,-1\n-0.125,1e-3,4\n",
        "# y,heading,x\n-1,2.25,0.5\n4,-0.125,1e-3\n",
        "\"x\",\"y\",\"heading\"\n\"0.5\",\"-1\",\"2.25\"\n\"1e-3\",\"4\",\"-0.125\"\n",
        "x;y;heading\n0.5;-1;2.25\n1e-3;4;-0.125\n",
        "x\ty\theading\n0.5\t-1\t2.25\n1e-3\t4\t-0.125\n",
        // As numpy.savetxt writes it, with its comment.
        "# drawn with seed 3, twice\n5.0e-01 -1.0e+00 2.25e+00\n1.0e-03 4.0e+00 -1.25e-01\n",
        "\n\n# Starts of the study; don't edit.\n\nx,y,heading\n\n0.5,-1,2.25\n# half-way\n1e-3,4,-0.125\n\n",
        // Two files with a header each, put together.
        "# x,y,heading\n0.5,-1,2.25\n# x,y,heading\n1e-3,4,-0.125\n",
    ] {
        assert_eq!(csv(text), Ok(ROWS.to_vec()), "{text:?}");
    }
    assert_eq!(csv("0,1,3\n"), Ok(vec![[0.0, 1.0, 3.0]]));
    assert_eq!(csv("0.0,1.0,2.0\n"), Ok(vec![[0.0, 1.0, 2.0]]));
    assert_eq!(csv("5,1,2\n0,1,2\n").unwrap().len(), 2);
}

#[test]
fn what_cannot_be_meant_is_refused_by_its_name() {
    for (text, words) in [
        ("0,1,2\n0.5,-1,2.25\n", "numbers of the columns, which pandas writes"),
        (",0,1,2\n0,0.5,-1,2.25\n", "a column has no name (pandas writes row numbers so"),
        (",x,y,heading\n0,0.5,-1,2.25\n", "a column has no name"),
        (
            "0,0.5,-1,2.25\n",
            "line 1 has 4 numbers, a state has 3; if the first is the number of the row",
        ),
        ("x,y,speed\n", "`speed` is no state; expected the states `x,y,heading`, in any order"),
        ("# x,y,speed\n1,2,3\n", "`speed` is no state"),
        ("x,y\n", "`heading` is missing"),
        ("x,y,x\n", "`x` is there twice"),
        ("x,y,heading,note\n", "`note` is no state"),
        ("0,5;-1,0;2,25\n", "line 1: `0,5` has a decimal comma; write 0.5"),
        ("\"0,5\",\"1,0\",\"2,0\"\n", "decimal comma"),
        ("0,5,1,0,2,25\n", "line 1 has 6 numbers, a state has 3; if these are decimal commas"),
        ("0.5,-1,2.25,\n", "line 1 has 4 numbers, a state has 3; the line ends with a separator"),
        ("0.5,,2.25\n", "line 1: y is empty"),
        ("0.5,-1,two\n", "line 1: `two` is not a number"),
        ("0.5,-1,2.25\nx,y,heading\n", "line 2: `x` is not a number"),
        (
            "# x,y,heading\n1,2,3\n# heading,x,y\n1,2,3\n",
            "line 3: a second header, with the columns in another order",
        ),
        ("0.5,-1,nan\n", "state 0 (from 0): heading is not a finite f32"),
        ("0.5,1e39,0\n", "y is not a finite f32"),
        ("\"0.5,-1,2.25\n", "line 1: a quote is not closed"),
        ("0.5,-1,2.25\r1,2,3\r", "carriage return alone"),
        ("0.5,\u{2212}1,2.25\n", "is not a number"),
        ("# x y heading of the car\n", "no state in it"),
        ("", "no state in it"),
    ] {
        let message = csv(text).unwrap_err();
        assert!(message.contains(words), "{text:?}: {message}");
        assert!(message.contains("states.csv"), "{message}");
    }
    let utf16: Vec<u8> = "\u{feff}x,y\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(read("states.csv", &utf16).unwrap_err().contains("UTF-16; save it as UTF-8"));
    assert!(
        read("states.csv", b"0.5,\xb5,1\n").unwrap_err().contains("line 1 is no text in UTF-8")
    );
}

/// A .npy file with these numbers in the order that the file has them.
fn npy(values: &[f64], rows: u64, order: npyz::Order) -> Vec<u8> {
    let mut bytes = Vec::new();
    let options = npyz::WriteOptions::new().default_dtype().order(order).shape(&[rows, 3]);
    let mut writer = options.writer(&mut bytes).begin_nd().unwrap();
    writer.extend(values.iter().copied()).unwrap();
    writer.finish().unwrap();
    bytes
}

#[test]
fn arrays_are_whole_and_alone_in_their_file() {
    let values: Vec<f64> = ROWS.iter().flatten().map(|value| f64::from(*value)).collect();
    let whole = npy(&values, 2, npyz::Order::C);
    assert_eq!(read("states.npy", &whole), Ok(ROWS.to_vec()));
    let cut = &whole[..whole.len() - 1];
    assert!(read("states.npy", cut).unwrap_err().contains("truncated: 2 states announced"));
    let twice = [whole.clone(), whole].concat();
    assert!(read("states.npy", &twice).unwrap_err().contains("bytes follow the 2 states"));
}

proptest! {
    /// Whatever the order of the columns, the separator and the quotes: the same states.
    #[test]
    fn any_table_is_read_as_it_is_meant(
        rows in prop::collection::vec(prop::array::uniform3(-1e6_f32..1e6), 1..40),
        order in Just([0_usize, 1, 2]).prop_shuffle(),
        separator in prop::sample::select(vec![",", ";", "\t", ", ", " ; "]),
        style in 0..4_u8,
        ending in prop::sample::select(vec!["\n", "\r\n"]),
    ) {
        let quoted = |text: String| if style & 1 == 1 { format!("\"{text}\"") } else { text };
        let line = |cells: [String; 3]| order.map(|i| quoted(cells[i].clone())).join(separator);
        let mark = if style & 2 == 2 { "# " } else { "" };
        let mut text = format!("{mark}{}{ending}", line(NAMES.map(str::to_owned)));
        for row in &rows {
            text += &(line(row.map(|value| value.to_string())) + ending);
        }
        prop_assert_eq!(csv(&text), Ok(rows));
    }

    /// Column by column or row by row: the same states, over more than one piece too.
    #[test]
    fn both_orders_of_an_array_are_read(count in 1..9000_usize, seed in 0..1000_u32) {
        let value = |row: usize, column: usize| {
            f64::from((seed.wrapping_mul(31) + (7 * row + 3 * column) as u32) % 10_007) * 0.25
        };
        let states: Vec<[f32; 3]> =
            (0..count).map(|row| [0, 1, 2].map(|column| value(row, column) as f32)).collect();
        let by_rows: Vec<f64> = (0..count).flat_map(|row| [0, 1, 2].map(|c| value(row, c))).collect();
        let by_columns: Vec<f64> =
            (0..3).flat_map(|column| (0..count).map(move |row| (row, column)))
                .map(|(row, column)| value(row, column)).collect();
        let rows = npy(&by_rows, count as u64, npyz::Order::C);
        prop_assert_eq!(read("states.npy", &rows), Ok(states.clone()));
        let columns = npy(&by_columns, count as u64, npyz::Order::Fortran);
        prop_assert_eq!(read("states.npy", &columns), Ok(states));
    }

    /// No bytes make the reader panic or take them for states without numbers in them.
    #[test]
    fn no_text_is_read_without_a_word(text in "[0-9.,;# \"xy\n\t-]{0,60}") {
        if let Ok(states) = csv(&text) {
            prop_assert!(!states.is_empty());
        }
    }
}
