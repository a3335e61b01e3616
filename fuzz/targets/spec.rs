//! The text of a spec file: whatever it says, it is read or refused, and what was read is written and read back the
//! same.

#![no_main]

use curvelax::ensemble::Spec;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let Ok(spec) = Spec::from_toml(text) else { return };
    same_again(&spec);
    let Ok(valid) = spec.validate() else { return };
    same_again(&valid);
    let again = valid.clone().validate().unwrap();
    assert!(again == valid || debug(&again) == debug(&valid), "validated twice: {again:?}");
    // The first cell and the last: each is a spec of its own, or refused.
    for cell in [0, valid.sweep.cells() - 1] {
        assert_eq!(valid.sweep.labels(cell).len(), valid.sweep.axes().len());
        let _ = valid.sweep.name(cell);
        if let Ok(own) = valid.of_cell(cell).and_then(Spec::validate) {
            assert!(own.sweep.is_empty());
            same_again(&own);
        }
    }
});

/// That the spec reads back from its TOML.
fn same_again(spec: &Spec) {
    let text = spec.to_toml().expect("every spec can be written");
    let again = Spec::from_toml(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    // NaN is not equal to itself, but prints as it does.
    assert!(again == *spec || debug(&again) == debug(spec), "{text}");
}

fn debug(spec: &Spec) -> String {
    format!("{spec:?}")
}
