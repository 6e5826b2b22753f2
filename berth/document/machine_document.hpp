/// A whole machine as a folder of self-contained HTML pages, and a DBC file of each bus.
///
///     const auto files = document::document_of(machine, links);
///     for (const auto& file : files) ...            // "index.html", "bus-1.html", "slot-1-5.html", "device-1.html",
///                                                   // "field.dbc"
///
/// Contents: buses with their highest load and the bounds of their messages (`analysis`); slots with their devices and
/// boot-up (CiA 302-2's rules); links with deadline and bound; PDOs with their objects; a configured device's
/// differences from its defaults; the objects of each device description.
#pragma once

#include <string>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/traffic/link_network.hpp"

namespace berth::document {

struct DocumentFile {
  std::string name;  ///< of letters, digits, "-" and "."; unique even regardless of case
  std::string bytes;
};

/// `links`: of a plan without errors, or null: then PDOs are those of descriptions and configurations. `made_by`: shown
/// at the end of the first page.
[[nodiscard]] std::vector<DocumentFile> document_of(const design::Machine& machine, const traffic::LinkPlan* links,
                                                    const std::string& made_by);

}  // namespace berth::document
