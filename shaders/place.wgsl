// Places: the coordinates of nodes as a state holds them. Twin of crates/flow/src/number/place.rs.

/// How far it is to a place from another.
fn apart(origin: vec, to: vec) -> vec {
    return to - origin;
}

/// A place after an increment.
fn moved(place: vec, by: vec) -> vec {
    return place + by;
}

/// The coordinate of a place.
fn coordinate(place: vec) -> vec {
    return place;
}

/// The place at a coordinate.
fn placed(at: vec) -> vec {
    return at;
}
