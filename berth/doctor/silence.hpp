/// Findings based on silence: a silent bus, missing heartbeats. None is certain if this port may have missed frames, or
/// if a device answered.
#pragma once

#include <optional>
#include <string>

#include "berth/doctor/diagnose.hpp"

namespace berth::doctor {

class Silence {
 public:
  /// All must outlive this.
  Silence(const Heard& heard, const Expected& expected, const Answers& answers)
      : heard_(heard), expected_(expected), answers_(answers) {}

  /// Not one good frame: the common cause of everything missing.
  [[nodiscard]] std::optional<Diagnosis> of_bus() const;
  /// `jammed`: another node destroys frames, perhaps those of this one.
  [[nodiscard]] std::optional<Diagnosis> of_heartbeat(NodeId node, bool jammed) const;

  /// An answer showed that a device has this node-ID.
  [[nodiscard]] bool answered(NodeId node) const;
  /// The slot's node was not heard, and answered no question.
  [[nodiscard]] bool unheard(const places::SlotSpec& slot) const;
  /// Lowers a certainty that is based on silence, and adds the reason.
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
