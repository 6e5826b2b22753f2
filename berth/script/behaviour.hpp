/// Behaviour of a simulated device: a Lua 5.4 script that reads and writes the device's objects and is called when the
/// network writes them, on SYNC, on a changed NMT state and by timers of the simulated clock (docs/scripts.md).
///
///     script::Script text{"belt.lua", "device.every(10, function() device.write('Belt speed', 5) end)"};
///     if (auto wrong = script::check(text)) return *wrong;             // file:line:column
///     script::Behaviour belt(device, executor, text, random.fork(), listener);
///
/// A script has access to its device only: no files, no processes, no clock but the world's, random numbers from the
/// world's seed. Its resources are limited (`Limits`). A script that throws, runs too long or wants too much memory is
/// ended: its device sends EMCY 6200h with the line, the listener is told, and the device goes on without behaviour
/// until its next power-on or reset node, when the script starts again.
///
/// The cost of each operation of a script, so that no call takes long: an instruction counts 1 + t + s * s, where t is
/// the length of the longest text that the script has made since its start in KiB, and s the size of Lua's stack in 256
/// values. Memory counts one instruction for 256 bytes, and so does memory in use each time that Lua must collect all
/// of it because a limit is reached. Measured with the default limits on one core of 2026:
///
/// - `<` `<=` `>` `>=` of texts: strcoll for each piece between NUL bytes, 17 ns a byte; a call of them 1 s.
/// - `==` of texts, a text as a key or as a number, tonumber, rawequal: one pass; a call of them 0.1 s.
/// - `..`, string.rep, sub, lower, upper, reverse, format, char, pack, table.concat, pack: the memory of what they
///   make.
/// - string.byte, unpack, packsize, table.unpack, select, math.max, min: as many values as the stack holds, or one pass
///   over the form; a call of them 0.3 s.
/// - `#`, rawlen, rawget, rawset, type, string.len, the rest of math: constant.
/// - a field by a chain of `__index` or `__newindex`, which Lua ends at 2,000 tables: 25 us; a call of them 2.5 s.
/// - a call by a chain of `__call`: half the square of its length, 1 ns each; a call of them 0.4 s.
/// - an error that `pcall` catches counts 100.
/// - an object's name that `device.read` and the others look for counts one for 8 objects the first time, and one for
///   each object when there is none of the name.
/// - table.sort, insert, remove, pairs, tostring: written in Lua, and counted.
/// - the text itself, compiled: the names that are local at one place are a block.
///
/// Not available: patterns (string.find, match, gmatch, gsub), load, dofile, require, next, coroutines, debug, utf8,
/// io, os. A text, a table's values and the stack each have a limit of their own (`Limits::block`).
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "berth/base/finding.hpp"
#include "berth/base/random.hpp"
#include "berth/device/device.hpp"
#include "berth/rt/executor.hpp"

namespace berth::script {

/// A script's file name and text.
struct Script {
  std::string file;  ///< as shown in reports
  std::string text;
};
inline constexpr std::size_t longest_script = 256 * 1024;  ///< bytes

/// Compiles it without running it. Returns what is wrong, with line and column; empty: it can be run.
[[nodiscard]] std::optional<Finding> check(const Script& script);

/// Limits of one call of a script. A call runs its text, a handler or a timer's function.
struct Limits {
  std::uint32_t instructions = 100'000;  ///< of Lua's machine; memory counts too, one for 256 bytes
  std::size_t memory = 1024 * 1024;      ///< bytes that a script has at any time
  std::size_t block = 256 * 1024;        ///< bytes of one text, of a table's values, of Lua's stack
  std::uint32_t lines = 20;              ///< printed
  /// Of the host's processor; a last resort: the limits above end a call long before, and equally in each run. A call
  /// ended by this one is reported as `overran`, and ends the run.
  std::chrono::milliseconds processor = std::chrono::seconds(20);
};

/// A message of a script, by `print` or at its end.
struct Message {
  enum class Kind : std::uint8_t {
    printed,
    failed,
    overran,  ///< by the host's clock: the run is no longer that of its seed, so it must end
    ended,    ///< because of `Listener::script_must_end`
  };
  Kind kind = Kind::printed;
  std::string file;
  int line = 0;  ///< counts from 1; 0 = unknown
  std::string text;
};
/// "belt.lua:12: 2000h:00 is UNSIGNED8, 300 does not fit"; for printed text the text only.
[[nodiscard]] std::string to_string(const Message& told);

/// EMCY of a script that failed: user software (CiA 301 §7.2.7.2.1), register bit 0; bytes 0 and 1 of the
/// manufacturer's field are the line.
inline constexpr std::uint16_t emcy_failed = 0x6200;

class Machine;

class Behaviour {
 public:
  /// Called from jobs. Must not destroy the behaviour or its device.
  class Listener {
   public:
    virtual void script_told(const Message& told) noexcept = 0;
    /// Asked during a long call, about every ten milliseconds: true (for example after a signal) ends the call and the
    /// script. Must only look.
    virtual bool script_must_end() noexcept { return false; }

   protected:
    ~Listener() = default;
  };

  /// Takes the device's callbacks (`device::Device::on`). `script` starts at each power-on and reset node of the
  /// device, and `random` starts again with it. Device, executor and listener must outlive it, and the device must not
  /// run after it is destroyed. Uses the heap, then and while the script runs.
  Behaviour(device::Device& device, rt::Executor& executor, Script script, Random random, Listener& listener,
            const Limits& limits = {});
  ~Behaviour();
  Behaviour(const Behaviour&) = delete;
  Behaviour& operator=(const Behaviour&) = delete;

  /// The device has lost power: timers and handlers end.
  void stop() noexcept;
  /// Between its start and its end or failure.
  [[nodiscard]] bool running() const noexcept;
  /// Bytes that the script uses at present.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  std::unique_ptr<Machine> machine_;
};

}  // namespace berth::script
