//! Arrays of NumPy.

use super::*;

#[test]
fn arrays_of_any_kind_of_number_are_read_and_nan_separates_outlines() {
    let ints = [0, 0, 2, 0, 2, 1_i32];
    assert_eq!(vertices(&read("a.npy", npy(&[3, 2], npyz::Order::C, &ints))[0]), [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)]);
    assert_eq!(read("a.npy", npy(&[3, 2], npyz::Order::C, &ints.map(|i| i as f32))).len(), 1);
    assert_eq!(read("a.npy", npy(&[3, 2], npyz::Order::C, &ints.map(|i| i as u8))).len(), 1);
    assert_eq!(read("a.npy", npy(&[3, 2], npyz::Order::C, &ints.map(i64::from))).len(), 1);
    let nan = f64::NAN;
    let two = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, nan, nan, 5.0, 5.0, 6.0, 5.0, 5.0, 6.0, nan, nan];
    let all = read("a.npy", npy(&[8, 2], npyz::Order::C, &two));
    assert_eq!((labels(&all), vertices(&all[1])), (vec!["a/1", "a/2"], vec![(5.0, 5.0), (6.0, 5.0), (5.0, 6.0)]));
    assert_eq!(labels(&read("a.npy", npy(&[2, 4, 2], npyz::Order::C, &two))), ["a/1", "a/2"]);
    // (2, 3, 2) in the order of Fortran: the first index runs fastest.
    let fortran = [0.0, 5.0, 1.0, 6.0, 0.0, 5.0, 0.0, 5.0, 0.0, 5.0, 1.0, 6.0];
    let same = read("a.npy", npy(&[2, 3, 2], npyz::Order::Fortran, &fortran));
    assert_eq!(vertices(&same[1]), vertices(&all[1]));
    let zip = npz(
        &[("b", npy(&[8, 2], npyz::Order::C, &two)), ("a\u{1b}", npy(&[3, 2], npyz::Order::C, &ints))],
        zip::CompressionMethod::Deflated,
    );
    assert_eq!(labels(&read("all.npz", zip)), ["b/1", "b/2", "a\\u{1b}"]);
}

#[test]
fn what_is_no_array_of_points_is_refused() {
    let good = npy(&[4, 2], npyz::Order::C, &[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
    for length in 0..good.len() {
        let message = refusal("a.npy", &good[..length]);
        assert!(message.contains("save it by numpy.save"), "{length}: {message}");
    }
    assert_refused("a.npy", &good[..good.len() - 1], &["the array of shape (4, 2) takes 64 bytes and has 63"]);
    assert_refused("a.npy", [&good[..], b"x"].concat(), &["takes 64 bytes and has 65"]);
    assert_refused("a.npy", "0,0\n1,0\n1,1\n", &["not a NumPy array, whatever its name says"]);
    let of = |shape: &[u64], values: &[f64]| npy(shape, npyz::Order::C, values);
    assert_refused("a.npy", of(&[2, 4], &[0.0; 8]), &["the array has the shape (2, 4); "]);
    assert_refused("a.npy", of(&[4], &[0.0; 4]), &["the array has the shape (4,); "]);
    assert_refused("a.npy", of(&[0, 2], &[]), &["the array holds no points"]);
    assert_refused("a.npy", of(&[2, 2], &[f64::NAN; 4]), &["the array holds no points"]);
    assert_refused("a.npy", of(&[3, 2], &[0.0, 0.0, 1.0, f64::NAN, 0.0, 1.0]), &["row 1: `NaN` is not finite"]);
    assert_refused("a.npy", of(&[3, 2], &[0.0, 0.0, f64::INFINITY, 0.0, 0.0, 1.0]), &["row 1: `inf` is not finite"]);
    assert_refused("a.npy", npy(&[1, 2], npyz::Order::C, &[true, false]), &["the numbers are of the type '|b1'"]);
    let header = |text: &str| {
        let mut bytes = [npy::MAGIC, &[1, 0], &(text.len() as u16).to_le_bytes()].concat();
        bytes.extend(text.as_bytes());
        bytes
    };
    for text in [
        "",
        "{}",
        "nonsense\u{1b}[31m",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999, 9999999999), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999, 2), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-4, 2), }",
        "{'descr': '|O', 'fortran_order': False, 'shape': (4, 2), }",
        "{'descr': [('x', '<f8'), ('y', '<f8')], 'fortran_order': False, 'shape': (4,), }",
        &"[".repeat(60_000),
    ] {
        refusal("a.npy", header(text));
    }
    let endless = [npy::MAGIC, &[2, 0, 0xff, 0xff, 0xff, 0xff]].concat();
    assert_refused("a.npy", endless, &["its header is damaged"]);
    let arrays = [("a", good.clone()), ("x", of(&[4], &[0.0; 4])), ("y", of(&[4], &[0.0; 4]))];
    let zip = npz(&arrays, zip::CompressionMethod::Deflated);
    assert_refused("a.npz", &zip, &["array `x`: the array has the shape (4,); ", "(2 of 3 outlines are refused)"]);
    for length in (0..zip.len()).step_by(7) {
        refusal("a.npz", &zip[..length]);
    }
    assert_refused("a.npz", npz(&[], zip::CompressionMethod::Stored), &["the file holds no arrays"]);
    assert_refused("a.npz", &good, &["no zip of arrays"]);
    // 200 MB of zeros in 200 kB.
    let bomb = npz(&[("a", vec![0; 200_000_000])], zip::CompressionMethod::Deflated);
    assert!(bomb.len() < 1_000_000);
    assert_refused("a.npz", bomb, &["array `a`: the arrays unpack to more than 64 MB"]);
}
