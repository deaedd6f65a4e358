//! Keys, and files of an update: what is signed is what is read, and what does not fit is refused with its addresses.

use std::fs;
use std::path::Path;

use north_boot::manifest::{BYTES, Manifest};

use crate::common::{Board, north};

/// An image of 64 bytes whose reset vector lies behind this address.
fn image(folder: &Path, name: &str, origin: u32) -> String {
    let path = folder.join(name);
    let words = [0x2001_0000, origin + 0x401].into_iter().chain([7; 14]);
    fs::write(&path, words.flat_map(u32::to_le_bytes).collect::<Vec<u8>>()).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_file_is_signed_for_both_slots() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (key, out) = (path("owner.key"), path("both.update"));
    let (code, public, error) = north(&["update", "key", &key]);
    assert_eq!((code, public.trim().len()), (0, 64), "{error}");
    // A key is never written over.
    assert_eq!(north(&["update", "key", &key]).0, 1);

    let [a, b] =
        [("a.bin", 0x0802_0000), ("b.bin", 0x0808_0000)].map(|(name, origin)| image(folder.path(), name, origin));
    let (code, _, error) = north(&["update", "sign", "--key", &key, "--out", &out, &b, &a]);
    assert!(code == 1 && error.contains("its start is at 0x08080401, and the slot begins at 0x08020000"), "{error}");
    let (code, _, error) = north(&["update", "sign", "--key", &key, "--out", &out, "--revision", "0123abcd", &a, &b]);
    assert_eq!(code, 0, "{error}");
    let file = fs::read(&out).unwrap();
    let public: Vec<u8> = (0..32).map(|at| u8::from_str_radix(&public[2 * at..2 * at + 2], 16).unwrap()).collect();
    for (signed, origin) in file.chunks(BYTES + 64).zip([0x0802_0000, 0x0808_0000]) {
        let manifest = Manifest::read(signed).unwrap();
        assert_eq!((manifest.origin, manifest.length, &manifest.revision[..8]), (origin, 64, b"0123abcd".as_slice()));
        assert!(Manifest::is_signed(signed[..BYTES].try_into().unwrap(), public.as_slice().try_into().unwrap()));
    }

    // The instrument in a process of the host has no slots.
    let board = Board::on(&["--speed", "100"]);
    let (code, _, error) = north(&["update", &out, "--port", &board.port]);
    assert!(code == 1 && error.contains("no free slot"), "{error}");
}
