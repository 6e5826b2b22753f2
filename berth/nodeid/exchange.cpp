#include "berth/nodeid/exchange.hpp"

#include <algorithm>

#include "berth/can/empty_bus.hpp"

namespace berth::nodeid {

Exchange::~Exchange() { end(); }

bool Exchange::start() noexcept {
  owner_->current_ = this;
  executor().after(times_.send_timeout, *this);
  if (owner_->dispatcher_->send(frame_, *this) != can::Queued::yes) fail_with("the port does not take a request");
  return true;
}

void Exchange::sent(rt::Time at) noexcept {
  outcome_ = at;
  if (times_.first.count() == 0) {
    end();
    finish();
    return;
  }
  open_ = true;
  owner_->opened_ = at;
  if (times_.most.count() > 0) limit_ = at + times_.most;
  stay_open(at + times_.first);
}

void Exchange::stay_open(rt::Time until) noexcept {
  closes_ = std::min(until, limit_);
  executor().at(closes_, *this);
}

// The one timer: the wait for the confirmation, then the window.
void Exchange::run() noexcept {
  if (!open_) {
    fail_with(can::no_acknowledge);
    return;
  }
  end();
  finish();
}

void Exchange::fail_with(const char* text) noexcept {
  outcome_ = fail(Errc::bus, text);
  end();
  finish();
}

void Exchange::end() noexcept {
  cancel();
  open_ = false;
  if (owner_->current_ != this) return;
  owner_->current_ = nullptr;
  owner_->dispatcher_->withdraw(*this);
}

void Exchanges::heard(rt::Time at) noexcept {
  if (!open() || current_->times_.after_last.count() == 0) return;
  current_->stay_open(std::max(at + current_->times_.after_last, opened_ + current_->times_.least));
}

void Exchanges::delayed(rt::Time at) noexcept {
  if (!open() || current_->times_.after_last.count() == 0) return;
  current_->stay_open(std::max(at + current_->times_.after_last, current_->closes_));
}

void Exchanges::close() noexcept {
  if (!open()) return;
  auto& done = *current_;
  done.end();
  done.finish();
}

}  // namespace berth::nodeid
