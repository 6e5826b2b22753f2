/// A network cable between some machines and a broker that can be cut: a TCP proxy, in a process of its own.
///
/// While it is cut it passes nothing on, in neither direction, and says so to nobody: connections stay, and new ones
/// get no answer, as behind a switch that has lost its power. When it is mended it resets what it held.
#pragma once

#include <cstdint>

namespace berth::bench {

/// Serves until its standard input ends. Says its port in the first line; obeys the lines "cut" and "mend".
int run_cable(std::uint16_t to_port);

}  // namespace berth::bench
