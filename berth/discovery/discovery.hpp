/// One interface for finding the devices of a bus by any scheme: the published methods and Berth's planners.
///
/// A discovery finds LSS addresses. It binds no device: the caller decides which one gets which node-ID, either after
/// all are known (`places::plan`) or at once by an `Assigner`. Everything on Fastscan needs an `Assigner`, because a
/// device answers until it has a node-ID, and none is left in LSS configuration to keep it silent. The node-ID is the
/// device's own, or one that is lent and taken back later.
///
///     Options options;                               // must outlive the task, as `known` must
///     auto report = co_await discovery.find(known, options);
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <tuple>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/lss/vacancy.hpp"
#include "berth/rt/executor.hpp"
#include "berth/rt/task.hpp"

namespace berth::nodeid {
struct DiscoveryReport;
}

namespace berth::discovery {

/// The published procedures, and Berth's own, which send the same requests and find the same devices sooner.
enum class Method : std::uint8_t {
  rand,              ///< paper 1: nine requests per device
  and_protocol,      ///< RAND's predecessor: thirteen requests per device
  fastscan,          ///< CiA 305, bit by bit: 129 to 133 requests per device
  feedback_29,       ///< paper 4, Table 2: nine requests per device
  feedback_11,       ///< paper 4, sixteen base frames: 33 requests per device
  identify,          ///< CiA 305's identify ranges, halved: finds devices without Fastscan, and those with a node-ID
  planner_rand,      ///< walks the tree of chunks once
  planner_fastscan,  ///< walks the tree of bits once, skipping what is known
  planner_feedback,  ///< the same, using every chunk that was heard
};
inline constexpr std::size_t methods = 9;
/// "rand", "and", "fastscan", "fastscan-feedback-29", "fastscan-feedback-11", "identify", "planner-rand",
/// "planner-fastscan", "planner-feedback".
[[nodiscard]] std::string_view name(Method method) noexcept;
/// The method of that name.
[[nodiscard]] Result<Method> method(std::string_view name) noexcept;

/// A device type that may be on the bus.
struct Kind {
  TypeCode type;
  std::optional<std::uint32_t> revision;  ///< if known
  friend bool operator==(const Kind&, const Kind&) = default;
};

/// What is known before a search. Errors in it cost time, but never a device and never give a wrong address.
struct Known {
  std::vector<Kind> kinds;             ///< of the slot table and the device library
  std::vector<LssAddress> expected;    ///< listed spares and devices seen before: asked for by name first
  std::vector<LssAddress> registered;  ///< devices in their slots: not searched for again
  /// Addresses of devices without a serial number that have their node-IDs. 40h to 43h select all equal devices at
  /// once; their different answers to 5Eh then destroy each other until the devices are bus-off. So `identify` skips
  /// these addresses.
  std::vector<LssAddress> equals{};
};

/// One device that was found.
struct Found {
  LssAddress address;
  rt::Time at{};                ///< when the last bit of its address became known
  NodeId active;                ///< the node-ID that it has, if the method shows it; unconfigured: none, or unknown
  NodeId assigned;              ///< the node-ID from the `Assigner`
  bool possible_clone = false;  ///< more than one device seems to have this address
  Method by = Method::rand;
};

/// Progress of a search by identify ranges.
struct Progress {
  bool again = false;      ///< everything is asked a second time, with pauses between the frames
  std::size_t kind = 0;    ///< of `kinds`, the current one
  std::size_t kinds = 0;   ///< `Known::kinds` and those of `Known::expected`
  double swept = 0;        ///< fraction of this kind's serial numbers, 0 to 1
  std::size_t silent = 0;  ///< gaps between this kind's devices that stayed silent: each is asked at the end
  std::size_t found = 0;   ///< by this call

  /// The search has come further than at `before`.
  [[nodiscard]] bool is_beyond(const Progress& before) const noexcept {
    return std::tie(again, kind, swept, silent) > std::tie(before.again, before.kind, before.swept, before.silent);
  }
};

/// Observes a discovery. Must not destroy it.
class Observer {
 public:
  virtual void found(const Found& device) noexcept = 0;
  /// Search by identify ranges: called between two requests after progress.
  virtual void progress(const Progress&) noexcept {}
  /// Called with no device in configuration: by identify ranges and the planners between two requests, by the published
  /// procedures after each device. False: the search ends with `more`; another call, with the devices found so far as
  /// registered, finds the others.
  virtual bool goes_on() noexcept { return true; }

 protected:
  ~Observer() = default;
};

/// Gives each found device a node-ID at once, after it is proven to be the only one in configuration.
class Assigner : public lss::Vacancy {
 public:
  /// `says_none`: it answered 5Eh and has none; otherwise it was not asked, or did not answer. Unconfigured: it gets
  /// none and goes back to waiting. A Fastscan method then ends with `Report::End::held`.
  virtual NodeId assign(const LssAddress& device, bool says_none) noexcept = 0;

 protected:
  ~Assigner() = default;
};

struct Options {
  /// Published methods: the published window, counted from the request's confirmation (`fixed`); 0: that of the
  /// method's own paper. Planners: the upper bound of the learnt window.
  rt::Duration window{0};
  rt::Duration shortest = std::chrono::milliseconds(1);  ///< planners: lower bound of the learnt window
  rt::Duration blocking{0};  ///< the longest that the bus can block an answer; added to every learnt window
  rt::Duration inhibit{0};   ///< least time between two requests
  Assigner* assigner = nullptr;
  bool store = false;  ///< with an assigner: also LSS store
  /// RAND's planner: proves every address by DIRS and DIS, so that a device slower than `window` spoils none. Published
  /// Fastscan: the address found must select a device that reports its serial number itself, before it is told and gets
  /// a node-ID. The published procedures do not ask; there a device that lost a request may lead to an address that no
  /// device has.
  bool confirm = false;
  Observer* observer = nullptr;  ///< may be null
  unsigned most_devices = 1000;
  /// A search by identify ranges ends with `Report::End::more` after this time; 0 = no limit.
  rt::Duration most_time{0};
  /// Search by identify ranges: also finds devices with a node-ID. False: it ends when identify non-configured (4Ch)
  /// stays unanswered, which saves one question for each gap between known devices.
  bool configured = true;
  unsigned retries = 4;  ///< restarts in a row without finding a device
  /// Planners on Fastscan, when devices with a node-ID answer too: the search ends with `Report::End::more` after about
  /// so many questions, and the next call with a slice continues there; 0 = no limit. For a bus at rest, where each of
  /// those devices costs some twenty questions. A device that joins at a place already asked is not found by this
  /// search.
  unsigned slice = 0;
};

struct Report {
  enum class End : std::uint8_t {
    complete,  ///< no device that this method can find is left
    gave_up,   ///< `retries` restarts in a row: a device answers and cannot be identified
    stuck,     ///< one address came repeatedly although its device was taken out
    limit,     ///< `most_devices`
    more,      ///< the time is over, or the observer stopped it; the next call continues there
    held,      ///< a device without a node-ID keeps answering: others were searched for beside it, or could not be
  };
  End end = End::complete;
  std::vector<Found> found;
  unsigned requests = 0;
  unsigned restarts = 0;
  unsigned unproven = 0;  ///< addresses that were answered for, but whose device did not confirm them
  rt::Time began{};
  rt::Time known{};  ///< when every address was known, excluding the last, unanswered question
  rt::Time ended{};
};
[[nodiscard]] const char* name(Report::End end) noexcept;
/// The report of RAND as published, in the form of all methods.
[[nodiscard]] Report report_of(const nodeid::DiscoveryReport& rand);

/// One method on one bus. One procedure at a time; never two methods with overlapping identifiers at once (S1.24): all
/// methods of a bus share one turn.
class Discovery {
 public:
  virtual ~Discovery() = default;
  [[nodiscard]] virtual Method method() const noexcept = 0;
  /// Finds every device that the method can find and that is not registered. Errors: `bus` a request could not be sent;
  /// `invalid` another procedure is running.
  [[nodiscard]] virtual rt::Task<Result<Report>> find(const Known& known, const Options& options) = 0;
  /// One question: is there a device that `find` would find?
  [[nodiscard]] virtual rt::Task<Result<bool>> anybody(const Options& options) = 0;
};

}  // namespace berth::discovery
