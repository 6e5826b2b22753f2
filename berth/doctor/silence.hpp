/// Findings that rest on what was not heard: a silent bus, heartbeats that are missing. Nothing of the kind is certain
/// when frames may have passed this port by, or when somebody answered.
#pragma once

#include <optional>
#include <string>

#include "berth/doctor/diagnose.hpp"

namespace berth::doctor {

class Silence {
 public:
  /// All must stay.
  Silence(const Heard& heard, const Expected& expected, const Answers& answers)
      : heard_(heard), expected_(expected), answers_(answers) {}

  /// Not one good frame: the one cause of all that would be missed.
  [[nodiscard]] std::optional<Diagnosis> of_bus() const;
  /// `jammed`: another node destroys frames, perhaps those of this one.
  [[nodiscard]] std::optional<Diagnosis> of_heartbeat(NodeId node, bool jammed) const;

  /// A question told that a device has this node-ID.
  [[nodiscard]] bool answered(NodeId node) const;
  /// The slot's node was not heard, and answered no question.
  [[nodiscard]] bool unheard(const places::SlotSpec& slot) const;
  /// Lowers a certainty that rests on what was not heard, and adds why.
  void weigh(Diagnosis& diagnosis, Certainty most) const;

 private:
  [[nodiscard]] Diagnosis only_errors() const;
  [[nodiscard]] Diagnosis not_a_sign(NodeId node, bool jammed) const;
  [[nodiscard]] Diagnosis no_heartbeat(NodeId node) const;
  [[nodiscard]] std::optional<Diagnosis> irregular(NodeId node) const;
  [[nodiscard]] std::optional<Diagnosis> stopped(NodeId node) const;

  const Heard& heard_;
  const Expected& expected_;
  const Answers& answers_;
};

}  // namespace berth::doctor
