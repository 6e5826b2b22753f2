/// Berth's own binding on a stage: `places::Binder` with its services, as `berth up` runs it.
#pragma once

#include <vector>

#include "berth/co/nmt_master.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/lss/master.hpp"
#include "berth/places/binder.hpp"
#include "berth/study/stage.hpp"

namespace berth::study {

class Commissioning {
 public:
  explicit Commissioning(Stage& stage);

  /// Asks under every node-ID, in parallel, whether it is free, as `operate::Network` does before the first binding.
  /// Then carries out the steps of `places::Binding` for each seat, stored and identified under the new node-ID.
  [[nodiscard]] rt::Task<void> bind(std::vector<places::Assignment> seats);
  /// Seats bound successfully.
  [[nodiscard]] unsigned bound() const noexcept { return bound_; }
  [[nodiscard]] lss::Master& lss() noexcept { return lss_; }

 private:
  [[nodiscard]] places::Binder::Services services() noexcept;
  rt::Task<void> ask(places::Assignment seat);
  rt::Task<void> bind_one(places::Assignment seat);

  can::Dispatcher* dispatcher_;
  lss::Master lss_;
  co::SdoClient sdo_;
  co::NmtMaster nmt_;
  places::BootWatch boots_;
  places::MemoryStore store_;
  places::VacancyTable vacancy_{};
  std::vector<LssAddress> others_;  // may be in configuration unheard
  unsigned bound_ = 0;
};

}  // namespace berth::study
