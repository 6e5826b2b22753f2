/// LSS Fastscan, the master's side (CiA 305; paper 4): finds a device without node-ID by asking for its LSS address bit
/// by bit, or by using its feedback.
///
///     Fastscan fastscan(master, options);                       // both must outlive the task
///     auto report = co_await fastscan.discover(owner);          // all devices, each is given a node-ID
///
/// It finds only devices that wait and have no node-ID, active and pending 255 (HU.6). A device with a node-ID, also a
/// stored or a hard-coded one, stays silent and is not found (S4.21). Slaves that answer nevertheless hide those with
/// higher addresses: the procedure then ends with `stuck` and has reported each once. Of several devices it finds the
/// one with the lowest address first (vendor, product, revision, serial number, most significant bit first), also with
/// feedback.
///
/// Silence has a meaning here, so every step waits its whole window, even after an early answer: the late answer of a
/// slower device would count for the next request (HC3.3). Answers that come even later, or twice, corrupt only the
/// address being assembled: an address is reported only after its device has stated it again (`confirm`). Otherwise the
/// scan begins anew.
///
/// Errors: `bus` a request could not be sent; `cancelled` the master was destroyed. The report contains all else.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/lss/master.hpp"
#include "berth/lss/vacancy.hpp"
#include "berth/rt/task.hpp"

namespace berth::lss {

/// How to ask the end of a 32-bit part.
enum class FastscanForm : std::uint8_t {
  standard,  ///< 32 bits, then the whole part with the next in LSSNext: 133 requests
  merged,    ///< the request for bit 0 carries LSSNext, and is repeated when bit 0 is 1: 129 to 133 requests
  literal,   ///< paper 4's trace: as `merged`, and LSSNext is 04h after the serial number (S4.14, S4.15)
};

struct FastscanOptions {
  FastscanForm form = FastscanForm::standard;
  Feedback feedback = Feedback::none;  ///< feedback of the scan; `base` needs `MasterOptions::feedback_base`
  rt::Duration window = std::chrono::milliseconds(10);  ///< of each request, from its confirmation; paper 4: 10, 20 ms
  /// Before it gets a node-ID, the device that the last match brought into configuration must state its address and be
  /// alone there (`prove_alone`). The published procedures do not ask.
  bool confirm = true;
  bool wait_first = true;  ///< begins with `04 00`: an aborted scan may have left a device in configuration
  bool store = false;      ///< 17h after the node-ID
  /// The known bits of the address: the bits of `known` where `known_bits` has ones are not asked for, only confirmed
  /// with their part. Not with feedback. If a device differs there, a scan ends without result.
  LssAddress known{};
  LssAddress known_bits{};
  unsigned retries = 4;  ///< repeated scans in a row
  unsigned most_devices = 1000;
};

/// A device that was found.
struct FastscanDevice {
  LssAddress address{};
  rt::Time at{};                ///< when the last bit of its address was confirmed
  unsigned requests = 0;        ///< of the scan that found it
  bool possible_clone = false;  ///< its last answer came twice: several devices seem to have this address
  NodeId active{};              ///< the node-ID it already has, as it reports (5Eh, with `confirm`): it gets no other
  NodeId assigned{};
  bool stored = false;  ///< 17h was answered with success
};

/// Decides which device gets which node-ID.
class FastscanOwner : public Vacancy {
 public:
  /// Called while the device is the only one in configuration. Unconfigured: it gets none, and the discovery ends with
  /// `held`.
  virtual NodeId assign(const FastscanDevice& device) noexcept = 0;
  /// The device has its node-ID, a new one or `FastscanDevice::active`, and was switched to waiting.
  virtual void assigned(const FastscanDevice&) noexcept {}
  /// Called after each device, when no device is in configuration. False: the discovery ends with `stopped`.
  virtual bool goes_on() noexcept { return true; }

 protected:
  ~FastscanOwner() = default;
};

struct FastscanReport {
  enum class End : std::uint8_t {
    complete,  ///< 80h stayed unanswered
    gave_up,   ///< `retries` scans in a row: a device answers and cannot be identified, or takes no node-ID
    held,      ///< the owner had no node-ID for the last device, the device refused it, or two devices have its address
    limit,     ///< `most_devices` reached
    stuck,     ///< a device with a node-ID, perhaps its new one, keeps answering (Lely core's slaves do)
    stopped,   ///< the owner stopped it; another call finds the other devices
  };
  End end = End::complete;
  std::vector<FastscanDevice> found{};
  unsigned requests = 0;  ///< 51h sent
  unsigned restarts = 0;
  rt::Time began{};
  rt::Time known{};  ///< when the last address was known
  rt::Time ended{};
};
[[nodiscard]] const char* name(FastscanReport::End end) noexcept;

/// One procedure at a time; use no other service of this master meanwhile.
class Fastscan {
 public:
  Fastscan(Master& master, const FastscanOptions& options) noexcept : master_(&master), options_(options) {}
  Fastscan(const Fastscan&) = delete;
  Fastscan& operator=(const Fastscan&) = delete;

  /// Finds one device, which is then in configuration. Empty: 80h stayed unanswered. `timeout`: `retries` scans in a
  /// row found no device although 80h was answered.
  [[nodiscard]] rt::Task<Result<std::optional<FastscanDevice>>> scan();
  /// The whole procedure: scan, configure node-ID, store if requested, switch to waiting, until 80h stays unanswered.
  [[nodiscard]] rt::Task<Result<FastscanReport>> discover(FastscanOwner& owner);

  /// Number of 51h sent, and of repeated scans, so far.
  [[nodiscard]] unsigned requests() const noexcept { return requests_; }
  [[nodiscard]] unsigned restarts() const noexcept { return restarts_; }

 private:
  enum class Outcome : std::uint8_t { nobody, lost, found };
  /// The result of one window.
  struct Heard {
    unsigned answers = 0;
    unsigned count = 0;
    std::array<std::uint16_t, 16> values{};  // the lowest feedback; paper 4 knows networks of up to 16 nodes (S4.12)
  };
  [[nodiscard]] rt::Task<Result<Outcome>> once();
  [[nodiscard]] rt::Task<Result<bool>> part(std::uint8_t sub);
  [[nodiscard]] rt::Task<Result<bool>> chunk(std::uint8_t sub, unsigned shift);
  [[nodiscard]] rt::Task<Result<bool>> ask(std::uint8_t sub, unsigned bit, std::uint8_t next);
  [[nodiscard]] rt::Task<Result<bool>> ask(FastscanRequest request);
  [[nodiscard]] rt::Task<Result<bool>> confirmed();
  [[nodiscard]] rt::Task<Result<FastscanReport::End>> give(FastscanReport& report, FastscanOwner& owner);
  [[nodiscard]] rt::Task<Result<FastscanReport::End>> leave(FastscanReport& report);
  [[nodiscard]] rt::Task<Result<FastscanReport::End>> give_up();
  [[nodiscard]] rt::Task<Result<std::optional<NodeId>>> active_id();
  [[nodiscard]] std::uint8_t after(std::uint8_t sub) const noexcept;
  void keep(const Reply& reply, bool lower) noexcept;

  Master* master_;
  FastscanOptions options_;
  FastscanDevice device_{};
  std::uint32_t id_ = 0;  // the known bits of the part
  Heard heard_{};
  unsigned requests_ = 0;
  unsigned restarts_ = 0;
};

}  // namespace berth::lss
