#include "berth/operate/loans.hpp"

#include <algorithm>
#include <utility>

namespace berth::operate {

Loans::Loans(places::SlotStore& store, places::BusName bus) : store_(&store), bus_(std::move(bus)) {}

Result<void> Loans::load() {
  const auto lent = store_->lent();
  if (!lent) return fail(lent.error());
  for (const auto& l : *lent) {
    const bool here = l.who().on.covers(bus_);
    if (!here || of(l.device) != nullptr) continue;
    all_.push_back({l.device, l.id});
    if (!borrowed(l.device)) borrowers_.push_back(l.device);
  }
  return {};
}

Result<void> Loans::lend(const Identity& device, NodeId id) {
  const auto written = store_->lend({device, bus_.machine, bus_.bus, id});
  if (!written) return written;
  std::erase_if(all_, [&](const Loan& l) { return l.device == device; });
  all_.push_back({device, id});
  if (!borrowed(device)) borrowers_.push_back(device);
  return {};
}

Result<void> Loans::end(const Identity& device) {
  if (of(device) == nullptr) return {};
  const auto written = store_->give_back({device, bus_});
  if (!written) return written;
  std::erase_if(all_, [&](const Loan& l) { return l.device == device; });
  return {};
}

void Loans::kept(const Identity& device) noexcept {
  const auto loan = std::ranges::find(all_, device, &Loan::device);
  if (loan != all_.end()) ++loan->tries;
}

void Loans::doubled(const Identity& device, bool so) noexcept {
  const auto loan = std::ranges::find(all_, device, &Loan::device);
  if (loan != all_.end()) loan->clones = so;
}

void Loans::seen(const Identity& device) noexcept {
  const auto loan = std::ranges::find(all_, device, &Loan::device);
  if (loan != all_.end()) loan->tries = 0;
}

const Loans::Loan* Loans::of(const Identity& device) const noexcept {
  const auto loan = std::ranges::find(all_, device, &Loan::device);
  return loan == all_.end() ? nullptr : &*loan;
}

const Loans::Loan* Loans::to_another(NodeId id, const Identity& device) const noexcept {
  const auto loan =
      std::ranges::find_if(all_, [&](const Loan& l) { return l.id == id && l.device.with(id) != device.with(id); });
  return loan == all_.end() ? nullptr : &*loan;
}

bool Loans::lent(NodeId id) const noexcept { return std::ranges::find(all_, id, &Loan::id) != all_.end(); }

bool Loans::borrowed(const Identity& device) const noexcept {
  return std::ranges::find(borrowers_, device) != borrowers_.end();
}

void Loans::bound(const Identity& device) noexcept { std::erase(borrowers_, device); }

}  // namespace berth::operate
