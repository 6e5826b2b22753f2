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
#pragma once

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
  std::uint32_t lines = 20;              ///< printed
};

/// What a script told, by `print` or by its end.
struct Told {
  enum class Kind : std::uint8_t { printed, failed };
  Kind kind = Kind::printed;
  std::string file;
  int line = 0;  ///< counts from 1; 0 = not known
  std::string text;
};
/// "belt.lua:12: 2000h:00 is UNSIGNED8, 300 does not fit"; of what was printed the text alone.
[[nodiscard]] std::string to_string(const Told& told);

/// EMCY of a script that failed: user software (CiA 301 §7.2.7.2.1), register bit 0; bytes 0 and 1 of the
/// manufacturer's field are the line.
inline constexpr std::uint16_t emcy_failed = 0x6200;

class Machine;

class Behaviour {
 public:
  /// Told from jobs. Must not destroy the behaviour or its device.
  class Listener {
   public:
    virtual void script_told(const Told& told) noexcept = 0;

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
