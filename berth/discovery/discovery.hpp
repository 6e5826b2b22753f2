/// One interface for finding the devices of a bus, whatever they speak: the published methods and Berth's planners.
///
/// A discovery finds LSS addresses. It binds no device: which one gets which node-ID is decided above, when all are
/// known (`places::plan`), or at once by an `Assigner`, which everything on Fastscan needs, because a device answers
/// until it has a node-ID, and none is left in LSS configuration to keep it silent: a node-ID of its own, or one that
/// is lent and taken back later.
///
///     Options options;                               // must outlive the task, as `known` must
///     auto report = co_await discovery.find(known, options);
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
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

/// The published procedures, and Berth's own that are made of the same requests and find the same devices sooner.
enum class Method : std::uint8_t {
  rand,              ///< paper 1: nine requests a device
  and_protocol,      ///< what RAND revises: thirteen requests a device
  fastscan,          ///< CiA 305, bit by bit: 129 to 133 requests a device
  feedback_29,       ///< paper 4, Table 2: nine requests a device
  feedback_11,       ///< paper 4, sixteen base frames: 33 requests a device
  identify,          ///< CiA 305's identify ranges, halved: devices without Fastscan, and those with a node-ID
  planner_rand,      ///< walks the tree of chunks once
  planner_fastscan,  ///< walks the tree of bits once, skipping what is known
  planner_feedback,  ///< the same with every chunk that was heard
};
inline constexpr std::size_t methods = 9;
/// "rand", "and", "fastscan", "fastscan-feedback-29", "fastscan-feedback-11", "identify", "planner-rand",
/// "planner-fastscan", "planner-feedback".
[[nodiscard]] std::string_view name(Method method) noexcept;
/// The method of that name.
[[nodiscard]] Result<Method> method(std::string_view name) noexcept;

/// A device type that may be there.
struct Kind {
  TypeCode type;
  std::optional<std::uint32_t> revision;  ///< when it is known
  friend bool operator==(const Kind&, const Kind&) = default;
};

/// What need not be asked. Being wrong costs time, never a device and never a wrong address.
struct Known {
  std::vector<Kind> kinds;             ///< of the slot table and the device library
  std::vector<LssAddress> expected;    ///< listed spares, devices seen before: asked for by name first
  std::vector<LssAddress> registered;  ///< sit in their slots: not to be found again
  /// Of devices without a serial number that have their node-IDs. 40h to 43h select all equal ones at once, and their
  /// different answers to 5Eh destroy each other until the devices are bus-off: `identify` passes these addresses over.
  std::vector<LssAddress> equals{};
};

/// One device that was found.
struct Found {
  LssAddress address;
  rt::Time at{};                ///< when the last bit of its address was known
  NodeId active;                ///< the node-ID that it has, as far as the method tells; unconfigured: none, or unknown
  NodeId assigned;              ///< what the `Assigner` gave it
  bool possible_clone = false;  ///< more than one device seems to have this address
  Method by = Method::rand;
};

/// How far a search by identify ranges is.
struct Progress {
  std::size_t kind = 0;   ///< of `kinds`, the one that is searched
  std::size_t kinds = 0;  ///< `Known::kinds` and those of `Known::expected`
  double swept = 0;       ///< of this kind's serial numbers, 0 to 1
  std::size_t found = 0;  ///< by this call
};

/// Watches a discovery. Must not destroy it.
class Observer {
 public:
  virtual void found(const Found& device) noexcept = 0;
  /// Search by identify ranges: between two requests, whenever it got on.
  virtual void progress(const Progress&) noexcept {}
  /// Asked with no device in configuration: by identify ranges and by the planners between two requests, by the
  /// published procedures after each device. False: the search ends with `more`; called again, with what it found as
  /// registered, it finds the others.
  virtual bool goes_on() noexcept { return true; }

 protected:
  ~Observer() = default;
};

/// Gives each found device a node-ID at once, when it is proven to be the only one in configuration.
class Assigner : public lss::Vacancy {
 public:
  /// `says_none`: it told that it uses none (5Eh); else it was not asked, or did not answer. Unconfigured: leave it
  /// without one; it goes back to waiting. A method on Fastscan then ends with `Report::End::held`.
  virtual NodeId assign(const LssAddress& device, bool says_none) noexcept = 0;

 protected:
  ~Assigner() = default;
};

struct Options {
  /// Published methods: their published window, counted from the request's confirmation (`fixed`), or that of the
  /// method's own paper when 0. Planners: the bound of the learnt window.
  rt::Duration window{0};
  rt::Duration shortest = std::chrono::milliseconds(1);  ///< planners: no learnt window is shorter
  rt::Duration blocking{0};  ///< the bus's worst blocking of an answer, added to every learnt window
  rt::Duration inhibit{0};   ///< least time between two requests
  Assigner* assigner = nullptr;
  bool store = false;  ///< with an assigner: LSS store too
  /// RAND's planner: every address is proven by DIRS and DIS, so that no device that is slower than `window` spoils
  /// one. Published Fastscan: the address found has to select a device that says its serial number itself, before it is
  /// told and gets a node-ID. The procedures as published do not ask, and a device that lost a request may then stand
  /// for an address that no device has.
  bool confirm = false;
  Observer* observer = nullptr;  ///< may be null
  unsigned most_devices = 1000;
  /// A search by identify ranges that takes longer ends with `Report::End::more`; 0 = never.
  rt::Duration most_time{0};
  /// Search by identify ranges: devices that have a node-ID too. False: it is over when identify non-configured (4Ch)
  /// stays unanswered, which saves a question for each gap between known devices.
  bool configured = true;
  unsigned retries = 4;  ///< restarts in a row without finding a device
  /// Planners on Fastscan, beside devices that answer with a node-ID: the search ends with `Report::End::more` after
  /// about so many questions, and called again with a slice it goes on where it was; 0 = never. For a bus at rest,
  /// where each of those devices costs some twenty questions. A device that comes meanwhile to a place that was asked
  /// is not found by this search.
  unsigned slice = 0;
};

struct Report {
  enum class End : std::uint8_t {
    complete,  ///< no device is left that this method can find
    gave_up,   ///< `retries` restarts in a row: a device answers and cannot be identified
    stuck,     ///< one address came again and again although it was taken out
    limit,     ///< `most_devices`
    more,      ///< time is over, or the observer stopped it; called again, it goes on where it was
    held,      ///< a device has no node-ID and answers on: others were searched for beside it, or could not be
  };
  End end = End::complete;
  std::vector<Found> found;
  unsigned requests = 0;
  unsigned restarts = 0;
  unsigned unproven = 0;  ///< addresses that were answered for, and whose device did not say that it has them
  rt::Time began{};
  rt::Time known{};  ///< every address was known; without the closing question that no device answered
  rt::Time ended{};
};
[[nodiscard]] const char* name(Report::End end) noexcept;
/// What RAND as published found, in the words of all methods.
[[nodiscard]] Report report_of(const nodeid::DiscoveryReport& rand);

/// One method on one bus. One procedure at a time; never two methods with overlapping identifiers at once (S1.24): a
/// bus has one turn for all of them.
class Discovery {
 public:
  virtual ~Discovery() = default;
  [[nodiscard]] virtual Method method() const noexcept = 0;
  /// Finds every device that the method can find and that is not registered. Errors: `bus` a request could not be sent;
  /// `invalid` another procedure is under way.
  [[nodiscard]] virtual rt::Task<Result<Report>> find(const Known& known, const Options& options) = 0;
  /// One question: is there a device that `find` would find?
  [[nodiscard]] virtual rt::Task<Result<bool>> anybody(const Options& options) = 0;
};

}  // namespace berth::discovery
