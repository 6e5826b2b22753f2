/// The planners on CiA 305 Fastscan, with and without feedback: one walk of the tree of addresses.
///
/// Slaves are unmodified: a slave answers 51h when it is at the part asked and the upper bits match, and then goes to
/// the part named by LSSNext (docs/protocols/cia305.md §Fastscan). So
///
/// - a question about some of the bits has LSSNext = LSSSub: no device moves, none is selected;
/// - a known part is confirmed with one message that moves on the matching devices (S4.9). Between two 80h, only *one*
///   value is ever asked so for each part, and after silence the next round begins with 80h. Otherwise devices that
///   moved unheard would mix with those of another value, and a wrong address could be put together;
/// - an exact serial number with LSSNext 0 selects the device. The device then reports its serial number itself (5Dh;
///   also each part of which several values were confirmed in this search), and shows that no other is in configuration
///   (`lss::prove_alone`). So an answer that is late, repeated or forged does not make a found device, nor does a
///   device that answers every question (CANopenNode in configuration; `Report::unproven`). A device that may have been
///   selected unheard goes back to waiting before another is selected.
///
/// A round is: 80h, the known parts, then the serial numbers below them, until no more devices are found there or more
/// than `Options::retries` places in a row have answered without leading to a device. An answer to the next 80h begins
/// the next round; the search is over when 80h stays unanswered for the longest window. So false silence, a device that
/// joins meanwhile, or one that forgets its part, cost time only.
///
/// Found devices leave the tree: they get a node-ID from the `Assigner`, and `04 00`, before the next request. No
/// device stays in configuration during the search for others. A device that gets no node-ID (no assigner, a refusal,
/// clones) waits and keeps answering all that it matches. From then on the walk asks only places beside such devices:
/// 128 questions for the first and fewer for each further one of its type. It ends with `Report::End::held`: 80h is
/// answered, so nothing can show that these are all. With learnt windows and many devices of a type this is the slower
/// way.
///
/// Some slaves (Lely core's) answer Fastscan even with a node-ID, so nothing takes them out of the tree. Each selected
/// device reports its node-ID (5Eh) and keeps it if it has one. It is reported once, unless it is registered. The walk
/// goes round it as above, asking for the registered ones by name first; if all such devices have a node-ID, it ends
/// `complete`. Meeting such a device again does not make it a clone; two answers to one question do.
///
/// Within a part the walk asks for the lower half first and infers the upper one from silence. Every eighth inference
/// in a row is checked by a question that must be answered. If a path stops answering, the walk returns to its deepest
/// place that still answers. After a device it asks for the next serial number, then its neighbourhood (while these
/// have been worth their questions), then the places where two devices were heard and only one went on.
///
/// With feedback every chunk that was heard is a child to visit, even if it was heard after the next request had been
/// chosen. Devices without feedback among them are found by bits in later rounds. The same applies if a device remains
/// whose feedback leads nowhere: after two rounds in a row that found no device, the next rounds go by bits alone.
#pragma once

#include <memory>

#include "berth/discovery/asker.hpp"
#include "berth/discovery/auto.hpp"
#include "berth/discovery/walk_memory.hpp"

namespace berth::discovery {

class Walker final : public Discovery {
 public:
  /// `feedback`: `planner_feedback`, else `planner_fastscan`, which ignores feedback.
  Walker(const Services& services, bool feedback);
  ~Walker() override;
  [[nodiscard]] Method method() const noexcept override {
    return feedback_ ? Method::planner_feedback : Method::planner_fastscan;
  }
  /// A registered device that answers has no node-ID: it is found too.
  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override;
  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override;
  /// In the last `find` or `anybody` a device sent feedback.
  [[nodiscard]] bool heard_feedback() const noexcept { return heard_feedback_; }
  [[nodiscard]] const Latency& latency() const noexcept { return asker_.latency(); }

 private:
  class Search;
  Services services_;
  Asker asker_;
  walk::Memory memory_;
  bool feedback_;
  bool goes_on_ = false;  // the last search ended with `more`
  bool busy_ = false;
  bool heard_feedback_ = false;
};

}  // namespace berth::discovery
