//! Settings that outlast power: records, a flash that loses power anywhere, and what comes of it.

mod damage;
mod flash;
mod power;
mod records;
