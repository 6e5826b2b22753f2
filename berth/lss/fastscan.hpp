/// LSS Fastscan, the master's side (CiA 305; paper 4): finds a device without node-ID by asking for its LSS address bit
/// by bit, or with feedback by asking the device.
///
///     Fastscan fastscan(master, options);                       // both must outlive the task
///     auto report = co_await fastscan.discover(owner);          // all devices, each is given a node-ID
///
/// It finds only devices that wait and have no node-ID, active and pending 255 (HU.6): a device that has one, also a
/// stored or a hard-coded one, stays silent and is not found (S4.21). Slaves that answer all the same hide those with
/// higher addresses: the procedure then ends with `stuck`, and each was told once. Of several the one with the lowest
/// address is found first (vendor, product, revision, serial number, most significant bit first), with feedback too.
///
/// Silence says something here, so every step waits its whole window, also when an answer came early: the late answer
/// of a slower device would be taken for one to the next request (HC3.3). What comes later still, or twice, spoils the
/// address that is being put together and nothing else: an address is reported only when its device said it once more
/// itself (`confirm`). Otherwise the scan begins anew.
///
/// Errors: `bus` a request could not be sent; `cancelled` the master was destroyed. All else is in the report.
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

/// How the end of a 32-bit part is asked.
enum class FastscanForm : std::uint8_t {
  standard,  ///< 32 bits, then the whole part with the next in LSSNext: 133 requests
  merged,    ///< the question for bit 0 carries LSSNext, and is repeated when bit 0 is 1: 129 to 133 requests
  literal,   ///< paper 4's trace: as `merged`, and LSSNext is 04h after the serial number (S4.14, S4.15)
};

struct FastscanOptions {
  FastscanForm form = FastscanForm::standard;
  Feedback feedback = Feedback::none;  ///< what the scan uses; `base` needs `MasterOptions::feedback_base`
  rt::Duration window = std::chrono::milliseconds(10);  ///< of each request, from its confirmation; paper 4: 10, 20 ms
  /// The device that the last match brought into configuration says itself what its address is, and that it is alone
  /// there (`prove_alone`), before it gets a node-ID. The published procedures do not ask.
  bool confirm = true;
  bool wait_first = true;  ///< begins with `04 00`: a scan broken off has left a device in configuration
  bool store = false;      ///< 17h after the node-ID
  /// What is known of the address already: the bits of `known` where `known_bits` has ones are not asked for, only
  /// confirmed with their part. Not with feedback. A device that differs there makes a scan end fruitless.
  LssAddress known{};
  LssAddress known_bits{};
  unsigned retries = 4;  ///< scans begun anew in a row
  unsigned most_devices = 1000;
};

/// One device that was found.
struct FastscanDevice {
  LssAddress address{};
  rt::Time at{};                ///< when the last bit of its address was confirmed
  unsigned requests = 0;        ///< that the scan which found it took
  bool possible_clone = false;  ///< its last answer came twice: more than one device seems to have this address
  NodeId active{};              ///< it has one already, as it says itself (5Eh, with `confirm`): it is given none
  NodeId assigned{};
  bool stored = false;  ///< 17h was answered with success
};

/// Which device is to have which node-ID.
class FastscanOwner : public Vacancy {
 public:
  /// Called while the device is the only one in configuration. Unconfigured: it gets none, and the discovery ends,
  /// `held`.
  virtual NodeId assign(const FastscanDevice& device) noexcept = 0;
  /// It has its node-ID, given now or `FastscanDevice::active`, and was told to wait.
  virtual void assigned(const FastscanDevice&) noexcept {}
  /// Asked after each device, when no device is in configuration. False: the discovery ends, `stopped`.
  virtual bool goes_on() noexcept { return true; }

 protected:
  ~FastscanOwner() = default;
};

struct FastscanReport {
  enum class End : std::uint8_t {
    complete,  ///< 80h stayed unanswered
    gave_up,   ///< `retries` scans in a row: a device answers and cannot be identified, or takes no node-ID
    held,      ///< the owner had no node-ID for the last one, the device refused it, or two devices have its address
    limit,     ///< `most_devices`
    stuck,     ///< a device that has a node-ID, perhaps the one it was just given, answers on (Lely core's slaves do)
    stopped,   ///< the owner said so; called again, it finds the others
  };
  End end = End::complete;
  std::vector<FastscanDevice> found{};
  unsigned requests = 0;  ///< 51h sent
  unsigned restarts = 0;
  rt::Time began{};
  rt::Time known{};  ///< the last address was known
  rt::Time ended{};
};
[[nodiscard]] const char* name(FastscanReport::End end) noexcept;

/// One procedure at a time, and no other service on this master meanwhile.
class Fastscan {
 public:
  Fastscan(Master& master, const FastscanOptions& options) noexcept : master_(&master), options_(options) {}
  Fastscan(const Fastscan&) = delete;
  Fastscan& operator=(const Fastscan&) = delete;

  /// Finds one device, which is then in configuration. Empty: 80h stayed unanswered. `timeout`: `retries` scans in a
  /// row found no device although 80h was answered.
  [[nodiscard]] rt::Task<Result<std::optional<FastscanDevice>>> scan();
  /// The whole procedure: scan, configure node-ID, store when asked for, switch to waiting, until 80h stays unanswered.
  [[nodiscard]] rt::Task<Result<FastscanReport>> discover(FastscanOwner& owner);

  /// 51h sent, and scans begun anew, so far.
  [[nodiscard]] unsigned requests() const noexcept { return requests_; }
  [[nodiscard]] unsigned restarts() const noexcept { return restarts_; }

 private:
  enum class Outcome : std::uint8_t { nobody, lost, found };
  /// What one window told.
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
  std::uint32_t id_ = 0;  // of the part, as far as it is known
  Heard heard_{};
  unsigned requests_ = 0;
  unsigned restarts_ = 0;
};

}  // namespace berth::lss
