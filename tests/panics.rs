//! The image that is flashed holds no new way to panic.

use std::collections::HashMap;

use north::engine::qemu::image;
use object::{Object as _, ObjectSection as _, ObjectSymbol as _};

/// Calls by which the image can panic: most are the compiler's and the executor's, none has a known way there. A new one is a
/// defect; with one less, write it down. (They were 48 in an image that was a fifth larger: optimised for size, the compiler leaves
/// standing some checks of shapes, in nalgebra, that are known beforehand: seventeen of these calls.)
const CALLS_TO_PANIC: usize = 57;

#[test]
fn the_image_has_no_new_way_to_panic() {
    let bytes = std::fs::read(image::build(image::Board::F405).unwrap()).unwrap();
    let file = object::File::parse(bytes.as_slice()).unwrap();
    let panics: HashMap<u64, &str> = file
        .symbols()
        .filter_map(|symbol| Some((symbol.address() & !1, symbol.name().ok()?)))
        .filter(|(_, name)| name.contains("panicking") || name.ends_with("_failed") || name.ends_with("_fail"))
        // Every `async fn` has one for the case that it is polled after its end: what polls them forgets them then.
        .filter(|(_, name)| !name.contains("async_fn_resumed"))
        .collect();
    let text = file.section_by_name(".text").unwrap();
    let halves: Vec<u32> =
        text.data().unwrap().as_chunks().0.iter().map(|&half| u16::from_le_bytes(half).into()).collect();
    let calls = halves.windows(2).zip((text.address()..).step_by(2)).filter_map(|(pair, at)| {
        let target = branch_target(pair[0], pair[1], at)?;
        let own = panics.get(&target)?;
        let (caller, _) = file
            .symbols()
            .filter_map(|symbol| {
                let inside = (symbol.address() & !1..(symbol.address() & !1) + symbol.size()).contains(&at);
                inside.then_some((symbol.name().ok()?, ()))
            })
            .next()?;
        // What panics calls what panics.
        (!panics.values().any(|name| *name == caller)).then(|| format!("{caller} -> {own}"))
    });
    let calls: Vec<String> = calls.collect();
    assert!(calls.len() <= CALLS_TO_PANIC, "{} calls: {calls:#?}", calls.len());
}

/// Where a branch with link, or without, of two halves leads (ARMv7-M A7.7.18 T1 and A7.7.12 T4).
fn branch_target(first: u32, second: u32, at: u64) -> Option<u64> {
    if first & 0xF800 != 0xF000 || !matches!(second & 0xD000, 0xD000 | 0x9000) {
        return None;
    }
    let sign = first >> 10 & 1;
    let [high, low] = [second >> 13 & 1, second >> 11 & 1].map(|bit| !(bit ^ sign) & 1);
    let offset = sign << 24 | high << 23 | low << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
    let offset = (offset << 7).cast_signed() >> 7;
    Some(at.wrapping_add_signed((offset + 4).into()))
}
