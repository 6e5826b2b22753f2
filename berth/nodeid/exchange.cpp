#include "berth/nodeid/exchange.hpp"

#include <algorithm>

#include "berth/can/empty_bus.hpp"
#include "berth/can/full_queue.hpp"

namespace berth::nodeid {

Exchange::~Exchange() { end(); }

bool Exchange::start() noexcept {
  owner_->current_ = this;
  limit_ = executor().now() + times_.send_timeout;
  send();
  return true;
}

void Exchange::send() noexcept {
  executor().at(limit_, *this);
  switch (owner_->dispatcher_->send(frame_, *this)) {
    case can::Queued::yes: break;
    case can::Queued::full: executor().at(can::again_at(executor().now(), limit_), *this); break;
    default: fail_with("the port does not take a request");
  }
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
  limit_ = times_.most.count() > 0 ? at + times_.most : rt::never;
  stay_open(at + times_.first);
}

void Exchange::stay_open(rt::Time until) noexcept {
  closes_ = std::min(until, limit_);
  executor().at(closes_, *this);
}

// The only timer: for the confirmation, then for the window.
void Exchange::run() noexcept {
  if (!open_) return executor().now() < limit_ ? send() : fail_with(can::no_acknowledge);
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
