/// The formulas (1) to (9) of paper 1 §IV, with its frame lengths as parameters (S1.39 to S1.47): for the bench's
/// table "published, by the formula, simulated". For a misprinted formula, both readings are given.
#pragma once

#include "berth/rt/executor.hpp"

namespace berth::nodeid::paper1 {

/// Frame lengths in bits.
struct FrameBits {
  unsigned guard = 150, guard_answer = 160;
  unsigned iurs = 185, ius = 145, dirs = 185;
  unsigned dis = 185;  ///< the paper's §IV: four data bytes; 145 when empty (S1.16)
  unsigned switch_global = 165, select = 195, select_answer = 165, configure = 165, configure_answer = 175;
};
/// As printed: extended frames at 145 + 10 bits a data byte, guarding at 150 and 160 (S1.40, S1.42, S1.47).
inline constexpr FrameBits published{};
/// The usual bound 80 + 10 bits a data byte for extended frames, DIS empty; LSS base frames with 8 bytes, 135 bits;
/// guarding as base frames of 55 and 65 bits.
inline constexpr FrameBits bound{.guard = 55,
                                 .guard_answer = 65,
                                 .iurs = 120,
                                 .ius = 80,
                                 .dirs = 120,
                                 .dis = 80,
                                 .switch_global = 135,
                                 .select = 135,
                                 .select_answer = 135,
                                 .configure = 135,
                                 .configure_answer = 135};
/// The AND protocol as the paper must have counted it to get 16.09 s (S1.44): every frame 135 bits.
inline constexpr FrameBits and_published{.iurs = 135, .ius = 135, .dirs = 135, .dis = 135};

/// The paper's conditions: 30 slaves, 50 kbit/s, 4 ms slave response, 1 ms master processing, 40 ms collect.
struct Conditions {
  unsigned bit_rate = 50'000;
  unsigned slaves = 30;
  rt::Duration t_resp = std::chrono::milliseconds(4);
  rt::Duration t_proc = std::chrono::milliseconds(1);
  rt::Duration t_collect = std::chrono::milliseconds(40);
  unsigned phases = 8;  ///< RAND; AND has 12
};
inline constexpr unsigned and_phases = 12;

[[nodiscard]] constexpr rt::Duration time_of(unsigned bits, const Conditions& c) noexcept {
  return rt::Duration(static_cast<rt::Duration::rep>(bits) * 1'000'000'000 / c.bit_rate);
}

/// (1) One slave guarded.
[[nodiscard]] constexpr rt::Duration t_detect(const FrameBits& f, const Conditions& c) noexcept {
  return time_of(f.guard, c) + time_of(f.guard_answer, c) + c.t_resp;
}
/// (2) All slaves guarded, as printed: T_resp once.
[[nodiscard]] constexpr rt::Duration t_detect_all(const FrameBits& f, const Conditions& c) noexcept {
  return c.slaves * (time_of(f.guard, c) + time_of(f.guard_answer, c)) + c.t_resp;
}
/// (3) The shortest collect window for so many distinct answers; the paper's "8 + 1" is `answers` 8.
[[nodiscard]] constexpr rt::Duration t_collect_least(const FrameBits& f, const Conditions& c,
                                                     unsigned answers = 8) noexcept {
  return c.t_resp + (answers + 1) * time_of(f.ius, c);
}
/// (4) One identification phase.
[[nodiscard]] constexpr rt::Duration t_id_phase(const FrameBits& f, const Conditions& c) noexcept {
  return time_of(f.iurs, c) + c.t_collect + c.t_proc;
}
/// (5) Direct identification.
[[nodiscard]] constexpr rt::Duration t_direct_id(const FrameBits& f, const Conditions& c) noexcept {
  return time_of(f.dirs, c) + c.t_resp + time_of(f.dis, c) + c.t_proc;
}
/// (6) One node found.
[[nodiscard]] constexpr rt::Duration t_node_id(const FrameBits& f, const Conditions& c) noexcept {
  return c.phases * t_id_phase(f, c) + t_direct_id(f, c);
}
/// (7) All nodes found: N x T_node_ID + T_ID_phase, as it must be read (S1.41).
[[nodiscard]] constexpr rt::Duration t_network_id(const FrameBits& f, const Conditions& c) noexcept {
  return c.slaves * t_node_id(f, c) + t_id_phase(f, c);
}
/// AND by formula (7): twelve phases, every frame 135 bits (S1.44). 16.088 s under the paper's conditions.
[[nodiscard]] constexpr rt::Duration t_and_network(Conditions c) noexcept {
  c.phases = and_phases;
  return t_network_id(and_published, c);
}
/// (7) as printed, with T_ID_phase as the factor: 1.386 s under the paper's conditions.
[[nodiscard]] constexpr rt::Duration t_network_id_printed(const FrameBits& f, const Conditions& c) noexcept {
  return (c.slaves + 1) * t_id_phase(f, c);
}
/// (8) One node bound.
[[nodiscard]] constexpr rt::Duration t_a_bind(const FrameBits& f, const Conditions& c) noexcept {
  return time_of(f.switch_global, c) + 4 * time_of(f.select, c) + time_of(f.select_answer, c) +
         time_of(f.configure, c) + time_of(f.configure_answer, c) + 2 * c.t_resp + c.t_proc;
}
/// (9) All new nodes bound.
[[nodiscard]] constexpr rt::Duration t_all_bind(const FrameBits& f, const Conditions& c) noexcept {
  return c.slaves * t_a_bind(f, c);
}

/// The numbers as the paper prints them.
struct Printed {
  static constexpr rt::Duration detect_all = std::chrono::milliseconds(190);
  static constexpr rt::Duration collect_least = std::chrono::microseconds(30'100);
  static constexpr rt::Duration network = std::chrono::milliseconds(11'200);
  static constexpr rt::Duration and_network = std::chrono::milliseconds(16'090);
  static constexpr rt::Duration all_bind = std::chrono::milliseconds(1'150);
};

}  // namespace berth::nodeid::paper1
