/// The doctor's expectations of a bus, and the texts of its findings: shared by `berth doctor` and the verb of a
/// running machine.
#pragma once

#include <string>
#include <vector>

#include "berth/command/reply.hpp"
#include "berth/design/machine.hpp"
#include "berth/doctor/conformance.hpp"
#include "berth/doctor/diagnosis.hpp"
#include "berth/doctor/questions.hpp"

namespace berth::command {

/// As the machine file has it.
[[nodiscard]] doctor::Expected expected_on(const design::Machine& machine, const design::Bus& bus);
[[nodiscard]] doctor::QuestionOptions questions_on(const design::Bus& bus, bool intrusive);
/// A doctor's default listening time: five heartbeat times, 5 s at least.
[[nodiscard]] rt::Duration listening_time(const design::Bus& bus);

[[nodiscard]] Json finding_json(const doctor::Diagnosis& finding, const std::string& bus);
/// The finding, its evidence, the advice.
[[nodiscard]] std::vector<std::string> finding_lines(const doctor::Diagnosis& finding, const std::string& bus);

/// Counts and checks of an examination. `problem`: why it ended early; empty: it did not.
[[nodiscard]] Json conformance_json(const doctor::Conformance& report, const std::string& bus, NodeId node,
                                    const std::string& problem);
/// The checks that did not pass, and the counts.
[[nodiscard]] std::vector<std::string> conformance_lines(const doctor::Conformance& report, const std::string& bus,
                                                         NodeId node);

}  // namespace berth::command
