#include "berth/doctor/silence.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/base/counted.hpp"
#include "berth/doctor/findings.hpp"

namespace berth::doctor {

using namespace std::chrono_literals;

bool Silence::answered(NodeId node) const {
  return std::ranges::any_of(answers_.present, [&](const auto& p) { return p.told && p.active == node; }) ||
         std::ranges::any_of(answers_.serials, [&](const auto& a) { return a.node == node && a.answers > 0; });
}

bool Silence::unheard(const places::SlotSpec& slot) const {
  return signs_of(heard_.node(slot.id), expected_.predefined_pdos).count == 0 && !answered(slot.id);
}

void Silence::weigh(Diagnosis& diagnosis, Certainty most) const {
  if (heard_.complete() || diagnosis.certainty <= most) return;
  diagnosis.certainty = most;
  if (heard_.down.count() > 0) {
    diagnosis.evidence.push_back(
        fmt::format("this port was down or bus-off for {:.1f} s of the time", in_ms(heard_.down) / 1000));
  }
  if (heard_.lost > 0) diagnosis.evidence.push_back("this port lost " + counted(heard_.lost, "frame"));
}

// ---- a silent bus ----

std::optional<Diagnosis> Silence::of_bus() const {
  const bool anybody = answers_.frames > 0 || answers_.blank || !answers_.present.empty() || !answers_.serials.empty();
  if (heard_.frames > 0 || anybody) return std::nullopt;
  if (heard_.errors > 0) return only_errors();
  auto d = finding(expected_, Kind::silent_bus, Certainty::certain);
  d.what = "nothing was heard on this bus";
  d.evidence.push_back(fmt::format("not one frame in {:.1f} s", in_ms(heard_.listened()) / 1000));
  if (answers_.asked) d.evidence.emplace_back("no device answered the questions");
  weigh(d, Certainty::possible);
  const auto patience = std::max<rt::Duration>(expected_.heartbeat_timeout, 1s);
  if (heard_.listened() < patience) {
    d.certainty = Certainty::possible;
    d.evidence.push_back(fmt::format("a healthy bus may be silent for {:g} ms: listen longer", in_ms(patience)));
  }
  if (!heard_.knows_errors) {
    d.certainty = std::min(d.certainty, Certainty::likely);
    d.evidence.emplace_back("this port counts no errors: at a wrong bit rate it would hear nothing either");
  }
  d.advice =
      "is the bit rate right (`berth scan --bitrate auto`), is the cable plugged in, do the devices have power, is the "
      "bus terminated?";
  if (!answers_.asked) {
    d.advice += " Devices without a node-ID are silent, too: `berth doctor --active` asks for them";
  }
  return d;
}

// Whether a slot's node is there is then unknown.
Diagnosis Silence::only_errors() const {
  auto d = finding(expected_, Kind::wrong_bit_rate, Certainty::possible);
  d.count = heard_.errors;
  d.first = heard_.from;
  d.last = heard_.to;
  d.what = "this port hears errors and not one good frame: perhaps its own bit rate is wrong";
  d.evidence.push_back(
      fmt::format("{} errors and no frame in {:.1f} s", heard_.errors, in_ms(heard_.listened()) / 1000));
  d.evidence.push_back(
      fmt::format("this port's counters went up to TEC {}, REC {}", heard_.worst.tec, heard_.worst.rec));
  if (heard_.worst.bus_off) d.evidence.emplace_back("this port was bus-off");
  d.advice =
      "is the bit rate right (`berth scan --bitrate auto`), are both ends terminated, is a line shorted or CAN_H and "
      "CAN_L swapped?";
  return d;
}

// ---- heartbeats ----

std::optional<Diagnosis> Silence::of_heartbeat(NodeId node, bool jammed) const {
  const auto* slot = expected_.slot(node);
  const auto patience = expected_.heartbeat_timeout;
  if (slot == nullptr || patience.count() == 0) return stopped(node);
  if (heard_.listened() <= patience) return std::nullopt;
  const auto& heard = heard_.node(node);
  if (signs_of(heard, expected_.predefined_pdos).count == 0 && !answered(node)) {
    if (slot->optional) return std::nullopt;
    return not_a_sign(node, jammed);
  }
  const bool guarded = heard.guard_answers > 0 && heard.guard_answers * 2 >= heard.guard_requests;
  if (guarded) return std::nullopt;
  return heard.beat.count == 0 ? no_heartbeat(node) : irregular(node);
}

Diagnosis Silence::not_a_sign(NodeId node, bool jammed) const {
  auto d = finding(expected_, Kind::missing_heartbeat, jammed ? Certainty::likely : Certainty::certain, node);
  d.what = fmt::format("{} is silent", who(expected_, node));
  d.evidence.push_back(fmt::format("nothing heard of it in {:.1f} s; its heartbeat is due every {:g} ms",
                                   in_ms(heard_.listened()) / 1000, in_ms(expected_.heartbeat_period)));
  if (jammed) d.evidence.emplace_back("another node destroys frames: its own may be among them");
  weigh(d, Certainty::likely);
  d.advice = "does it have power and a node-ID, is it on this bus at this bit rate, is its object 1017h set?";
  return d;
}

Diagnosis Silence::no_heartbeat(NodeId node) const {
  const auto signs = signs_of(heard_.node(node), expected_.predefined_pdos);
  auto d = finding(expected_, Kind::missing_heartbeat, Certainty::certain, node);
  when(d, signs);
  d.what = fmt::format("{} is there and sends no heartbeat", who(expected_, node));
  if (signs.count > 0) d.evidence.push_back(fmt::format("other messages of it: {}", times(signs)));
  if (answered(node)) d.evidence.emplace_back("it answered when it was asked");
  d.evidence.push_back(fmt::format("no heartbeat in {:.1f} s", in_ms(heard_.listened()) / 1000));
  weigh(d, Certainty::likely);
  d.advice = fmt::format("set its object 1017h to {:g} ms; `berth up` does", in_ms(expected_.heartbeat_period));
  return d;
}

std::optional<Diagnosis> Silence::irregular(NodeId id) const {
  const auto& node = heard_.node(id);
  const auto patience = expected_.heartbeat_timeout;
  Count gaps;
  auto before = heard_.from;
  for (const auto& beat : node.beats) {
    if (beat.at - before > patience) gaps.add(beat.at);
    before = beat.at;
  }
  const bool all_kept = node.beat.count == node.beats.size();
  const bool gone = heard_.to - node.beat.last > patience;
  if (!gone && (!all_kept || gaps.count == 0)) return std::nullopt;
  auto d = finding(expected_, Kind::missing_heartbeat, Certainty::certain, id);
  when(d, gone ? node.beat : gaps);
  d.what = gone ? fmt::format("the heartbeat of {} has stopped", who(expected_, id))
                : fmt::format("the heartbeat of {} has gaps", who(expected_, id));
  d.evidence.push_back(
      gone ? fmt::format("last heard at {:.3f} s, {:.0f} ms before the end", in_seconds(node.beat.last),
                         in_ms(heard_.to - node.beat.last))
           : fmt::format("silent for more than {:g} ms, until it came again: {}", in_ms(patience), times(gaps)));
  weigh(d, Certainty::possible);
  d.advice = "look for a loose plug, a lack of power, or an error-passive node; `berth status` shows what Berth knows";
  return d;
}

// A node without a slot is judged by its own period.
std::optional<Diagnosis> Silence::stopped(NodeId id) const {
  const auto& node = heard_.node(id);
  if (node.beats.size() < 6 || node.beat.count != node.beats.size()) return std::nullopt;
  std::vector<rt::Time> at;
  for (const auto& beat : node.beats) at.push_back(beat.at);
  const auto usual = rhythm(at, rt::Duration{0}).usual;
  const auto silence = heard_.to - node.beat.last;
  if (silence < std::max<rt::Duration>(4 * usual, 500ms)) return std::nullopt;
  auto d = finding(expected_, Kind::missing_heartbeat, Certainty::likely, id);
  when(d, node.beat);
  d.what = fmt::format("the heartbeat of {} has stopped", who(expected_, id));
  d.evidence.push_back(
      fmt::format("it came every {:.0f} ms, and not for {:.0f} ms at the end", in_ms(usual), in_ms(silence)));
  weigh(d, Certainty::possible);
  d.advice = "did it lose its power or its cable?";
  return d;
}

}  // namespace berth::doctor
