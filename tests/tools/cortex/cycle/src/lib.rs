//! Updates of `regen-control` in single precision, by number, for `count.c` to count.
#![no_std]

use core::hint::black_box;

use regen_control::{
    Estimator, Forgetting, GradientLaw, NaturalLaw, Observer, Payload, Physical, Settings,
};
use regen_runtime::{Parameter, Symbol};

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}

/// Irregular numbers between -1 and 1.
struct Numbers(u32);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_103_515_245).wrapping_add(12_345);
        ((self.0 >> 8) & 0xffff) as f32 / 32_768.0 - 1.0
    }

    fn vector<const D: usize>(&mut self) -> [f32; D] {
        core::array::from_fn(|_| self.next())
    }

    fn columns<const D: usize, const P: usize>(&mut self) -> [[f32; D]; P] {
        core::array::from_fn(|_| self.vector())
    }
}

/// Calls `clock` before and after the second of two updates, the first of which starts filters, and
/// returns the difference of the counts.
fn estimator<const D: usize, const P: usize>(forgetting: Forgetting, clock: Clock) -> u32 {
    let mut numbers = Numbers(1);
    let settings = Settings { forgetting, block: 0.15, ..Settings::new(1e-3) };
    let Ok(estimator) = Estimator::<f32, D, P>::new(&settings, &[1.0; D]) else {
        return 0;
    };
    let Ok(mut estimator) = estimator.with_prior(&[0.0; P], &[1.0; P]) else {
        return 0;
    };
    let mut most = 0;
    // a block ends after 150 samples, with the longest update
    for _ in 0..160 {
        let (momentum, rate) = (numbers.columns(), numbers.columns());
        let effort = numbers.vector();
        let start = clock();
        let _ = black_box(estimator.update(black_box(&momentum), &rate, &effort));
        most = most.max(since(start, clock()));
    }
    most
}

/// A counter that counts down in 24 bits.
type Clock = extern "C" fn() -> u32;

fn since(start: u32, end: u32) -> u32 {
    start.wrapping_sub(end) & 0x00ff_ffff
}

/// The longest of some updates of a kind, in ticks; 0 beyond the last kind.
#[no_mangle]
pub extern "C" fn longest(kind: u32, clock: Clock) -> u32 {
    let mut numbers = Numbers(7);
    match kind {
        0 => since(clock(), clock()),
        1 => {
            let Ok(mut observer) = Observer::<f32, 6>::new(50.0, 1e-3) else {
                return 0;
            };
            let mut most = 0;
            for _ in 0..10 {
                let (p, n, u) = (numbers.vector(), numbers.vector(), numbers.vector());
                let start = clock();
                let _ = black_box(observer.update(black_box(&p), &n, &u));
                most = most.max(since(start, clock()));
            }
            most
        }
        2 => estimator::<2, 11>(Forgetting::Never, clock),
        3 => estimator::<2, 11>(Forgetting::Exponential(5.0), clock),
        4 => estimator::<2, 11>(Forgetting::Directional(5.0), clock),
        5 => estimator::<6, 10>(Forgetting::Exponential(5.0), clock),
        6 => estimator::<6, 36>(Forgetting::Exponential(5.0), clock),
        7 => estimator::<6, 36>(Forgetting::Directional(5.0), clock),
        8 => {
            let y: [[f32; 6]; 60] = numbers.columns();
            let s = numbers.vector();
            let Ok(mut law) = GradientLaw::<f32, 60>::new(&[0.0; 60], &[1.0; 60]) else {
                return 0;
            };
            let start = clock();
            let _ = black_box(law.update(black_box(&y), &s, 1e-3));
            since(start, clock())
        }
        9 => {
            let y: [[f32; 6]; 60] = numbers.columns();
            let s = numbers.vector();
            let owners = ["1", "2", "3", "4", "5", "6"];
            let parameters: [Parameter<'_>; 60] = core::array::from_fn(|k| {
                Parameter::new(Symbol::INERTIAL[k % 10], owners[k / 10])
            });
            let start: [f32; 60] = core::array::from_fn(|k| BALL[k % 10]);
            let Ok(mut law) = NaturalLaw::<f32, 60, 6>::new(&parameters, &start, 1.0, 0.0) else {
                return 0;
            };
            let start = clock();
            let _ = black_box(law.update(black_box(&y), &s, 1e-3));
            since(start, clock())
        }
        // one Newton step of a body's projection: twice, less once
        10 => projected(clock, 2).wrapping_sub(projected(clock, 1)),
        11 => {
            let Ok(mut payload) = Payload::<f32, 6>::new(&Settings::new(1e-3), &[1.0; 6], 10.0, 0.3)
            else {
                return 0;
            };
            for _ in 0..4100 {
                let (momentum, rate) = (numbers.columns(), numbers.columns());
                let (p, n, u) = (numbers.vector(), numbers.vector(), numbers.vector());
                let _ = payload.update((&p, &n), (&momentum, &rate), &u);
            }
            let start = clock();
            let _ = black_box(black_box(&payload).load());
            // the deviations too if there is a mass
            let _ = black_box(payload.at(&BALL));
            since(start, clock())
        }
        _ => 0,
    }
}

const BALL: [f32; 10] = [0.1, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.0, 2.0];

fn projected(clock: Clock, steps: usize) -> u32 {
    let Ok(set) = Physical::<10, 1>::new(&Symbol::INERTIAL.map(|symbol| Parameter::new(symbol, "1")))
    else {
        return 0;
    };
    let unit: [[f32; 10]; 10] =
        core::array::from_fn(|i| core::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }));
    let mut wanted = BALL;
    wanted[9] = -1.0;
    let start = clock();
    let _ = black_box(set.closest((black_box(&unit), &wanted), &BALL, steps, 1e-6));
    since(start, clock())
}
