/// Pages of device descriptions: one for each description that slots of the machine have.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "berth/document/bus_signals.hpp"
#include "berth/document/machine_document.hpp"

namespace berth::document {

class DevicePages {
 public:
  explicit DevicePages(const std::vector<DescribedSlot>& slots);
  /// HTML: the slot's type, as a link if it has a page.
  [[nodiscard]] std::string link(const design::Slot& slot) const;
  [[nodiscard]] std::vector<DocumentFile> pages() const;

 private:
  std::vector<const DescribedSlot*> first_;  // one for each different description; they must outlive this
};

/// HTML: the objects whose configured values differ from the description's defaults.
[[nodiscard]] std::string differences(const DescribedSlot& slot);

}  // namespace berth::document
