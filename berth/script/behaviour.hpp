/// Behaviour of a simulated device: a Lua 5.4 script that reads and writes the device's objects and is called when the
/// network writes them, on SYNC, on a changed NMT state and by timers of the simulated clock (docs/scripts.md).
///
///     script::Script text{"belt.lua", "device.every(10, function() device.write('Belt speed', 5) end)"};
///     if (auto wrong = script::check(text)) return *wrong;             // file:line:column
///     script::Behaviour belt(device, executor, text, random.fork(), listener);
///
/// A script sees its device and nothing else: no files, no processes, no clock but the world's, random numbers from the
/// world's seed. What it may take is bounded (`Limits`). A script that throws, runs too long or wants too much memory
/// is ended: its device sends EMCY 6200h with the line, the listener is told, and the device goes on without behaviour
/// until its next power-on or reset node, when the script begins anew.
///
/// What each thing that a script can do costs, so that no call takes long. An instruction counts 1 + t + s * s: t is
/// the length of the longest text that the script has made since its begin in KiB, s the size of Lua's stack in 256
/// values. Memory counts one instruction for 256 bytes, and so does what is in use, each time that Lua has to collect
/// all of it because a bound is reached. Measured with the default limits on one core of 2026:
///
/// - `<` `<=` `>` `>=` of texts: strcoll for each piece between NUL bytes, 17 ns a byte; a call of them 1 s.
/// - `==` of texts, a text as a key or as a number, tonumber, rawequal: one pass; a call of them 0.1 s.
/// - `..`, string.rep, sub, lower, upper, reverse, format, char, pack, table.concat, pack: the memory of what they
/// make.
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
/// Not there: patterns (string.find, match, gmatch, gsub), load, dofile, require, next, coroutines, debug, utf8, io,
/// os. A text, a table's values and the stack have a bound of their own each (`Limits::block`).
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

/// A script as a file holds it.
struct Script {
  std::string file;  ///< as reports show it
  std::string text;
};
inline constexpr std::size_t longest_script = 256 * 1024;  ///< bytes

/// Compiles it and runs nothing. What is wrong, with line and column; empty: it can be run.
[[nodiscard]] std::optional<Finding> check(const Script& script);

/// What one call of a script may take. A call is the run of its text, of a handler or of a timer's function.
struct Limits {
  std::uint32_t instructions = 100'000;  ///< of Lua's machine; memory taken counts too, one for 256 bytes
  std::size_t memory = 1024 * 1024;      ///< bytes that a script has at any time
  std::size_t block = 256 * 1024;        ///< bytes of one text, of a table's values, of Lua's stack
  std::uint32_t lines = 20;              ///< printed
  /// Of the host's processor. The last resort: the bounds above end a call long before, and each run alike. What ends
  /// by this one is told as `overran`, and ends the run.
  std::chrono::milliseconds processor = std::chrono::seconds(20);
};

/// What a script told, by `print` or by its end.
struct Message {
  enum class Kind : std::uint8_t {
    printed,
    failed,
    overran,  ///< by the host's clock: what comes after is no run of this seed any more, so the run must end
    ended,    ///< because `Listener::script_must_end`
  };
  Kind kind = Kind::printed;
  std::string file;
  int line = 0;  ///< counts from 1; 0 = not known
  std::string text;
};
/// "belt.lua:12: 2000h:00 is UNSIGNED8, 300 does not fit"; of what was printed the text alone.
[[nodiscard]] std::string to_string(const Message& told);

/// EMCY of a script that failed: user software (CiA 301 §7.2.7.2.1), register bit 0; bytes 0 and 1 of the
/// manufacturer's field are the line.
inline constexpr std::uint16_t emcy_failed = 0x6200;

class Machine;

class Behaviour {
 public:
  /// Told from jobs. Must not destroy the behaviour or its device.
  class Listener {
   public:
    virtual void script_told(const Message& told) noexcept = 0;
    /// Asked while a call takes long, about each ten milliseconds: true (by a signal, say) ends it and the script. Must
    /// only look.
    virtual bool script_must_end() noexcept { return false; }

   protected:
    ~Listener() = default;
  };

  /// Takes the device's callbacks (`device::Device::on`). `script` begins at each power-on and reset node of the
  /// device; `random` begins anew with it. Device, executor and listener must outlive it, and the device must not run
  /// any more when it is gone. Uses the heap, then and while the script runs.
  Behaviour(device::Device& device, rt::Executor& executor, Script script, Random random, Listener& listener,
            const Limits& limits = {});
  ~Behaviour();
  Behaviour(const Behaviour&) = delete;
  Behaviour& operator=(const Behaviour&) = delete;

  /// The device has no power any more: timers and handlers end.
  void stop() noexcept;
  /// Between its begin and its end or failure.
  [[nodiscard]] bool running() const noexcept;
  /// Bytes that the script has now.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  std::unique_ptr<Machine> machine_;
};

}  // namespace berth::script
