//! Digests of different models differ, and a model's digest never changes, because files of factors
//! store it.

use regen_identify::identify::digest;

use crate::models::pendulum::Pendulum;
use crate::models::slider_crank::SliderCrank;

/// The expected digest was computed in Python with integers of any size, from the description of
/// [`digest`]: FNV-1a over the names, the indices, the base combinations, and the regressor's row
/// `[-0.7, 9.81 sin 0.01]` in ten digits, each text terminated by a zero byte.
#[test]
fn the_digest_of_a_model_is_the_hash_of_its_description() {
    assert_eq!(digest(&Pendulum), "828fb2c3d6cd23d7");
}

#[test]
fn models_with_other_names_or_lengths_have_other_digests() {
    let plain = SliderCrank::default();
    let all = [
        digest(&Pendulum),
        digest(&plain),
        // a difference of a hundred micrometres on a metre
        digest(&SliderCrank {
            crank: 1.0001,
            ..plain
        }),
        digest(&SliderCrank {
            home: [0.1, 0.0, 3.0],
            ..plain
        }),
    ];
    for (k, one) in all.iter().enumerate() {
        assert!(!all[..k].contains(one), "{all:?}");
        assert_eq!(one.len(), 16);
    }
    assert_eq!(digest(&plain), digest(&SliderCrank::default()));
    // a difference below the digest's ten digits
    let hardly = SliderCrank {
        crank: 1.0 + 1e-13,
        ..plain
    };
    assert_eq!(digest(&hardly), digest(&plain));
}
