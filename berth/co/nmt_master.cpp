#include "berth/co/nmt_master.hpp"

#include <algorithm>

#include "berth/co/retry_parts.hpp"

namespace berth::co {

namespace {
tl::unexpected<Error> command_never_left(const NmtRequest& request) noexcept {
  return fail(Error{.code = Errc::bus,
                    .node = request.target.node,
                    .text = "the NMT command never left: no device acknowledges it, or the port is down"});
}
}  // namespace

NmtMaster::~NmtMaster() {
  for (auto& entry : queue_) {
    if (entry.waiter == nullptr) continue;
    entry.waiter->master_ = nullptr;
    entry.waiter->finish();
  }
}

void NmtMaster::queue(NmtCommand command, NmtTarget target) {
  if (target.node > 127) {
    ++lost_;
    return;
  }
  push({{command, target}, nullptr});
}

NmtMaster::Send::~Send() {
  if (master_ == nullptr) return;
  auto& entries = master_->queue_;
  const auto it = std::ranges::find(entries, this, &Entry::waiter);
  if (it == entries.end()) return;
  if (it == entries.begin() && master_->sending_) {
    master_->dispatcher_->withdraw(*master_);
    master_->cancel();
    master_->sending_ = false;
  }
  entries.erase(it);
  master_->schedule();
}

bool NmtMaster::Send::start() noexcept {
  if (request_.target.node > 127) {
    result_ = fail(Errc::invalid, "an NMT command to an unconfigured node-ID");
    return false;
  }
  master_->push({request_, this});
  return true;
}

void NmtMaster::push(Entry entry) {
  queue_.push_back(entry);
  if (queue_.size() == 1) schedule();
}

void NmtMaster::schedule() noexcept {
  if (queue_.empty() || sending_) return;
  auto& executor = dispatcher_->executor();
  if (executor.now() < free_at_) {
    executor.at(free_at_, *this);
  } else {
    executor.post(*this);
  }
}

void NmtMaster::run() noexcept {
  if (queue_.empty()) return;
  const auto now = dispatcher_->executor().now();
  if (!sending_) {
    if (now < free_at_) return schedule();
    sending_ = true;
    give_up_ = now + send_timeout_;
    send_first();
  } else if (now >= give_up_) {
    if (pending()) dispatcher_->withdraw(*this);
    done(command_never_left(queue_.front().request));
  } else {
    send_first();
  }
}

void NmtMaster::send_first() noexcept {
  auto& executor = dispatcher_->executor();
  const auto& request = queue_.front().request;
  switch (dispatcher_->send(to_frame(request), *this)) {
    case can::Queued::yes: executor.at(give_up_, *this); break;
    case can::Queued::full: executor.at(std::min(executor.now() + full_retry, give_up_), *this); break;
    default: done(command_never_left(request));
  }
}

void NmtMaster::sent(rt::Time at) noexcept {
  free_at_ = at + inhibit_;
  done(at);
}

void NmtMaster::done(const Result<rt::Time>& result) noexcept {
  cancel();
  sending_ = false;
  auto* waiter = queue_.front().waiter;
  queue_.pop_front();
  if (!result) ++lost_;
  if (waiter != nullptr) {
    waiter->result_ = result;
    waiter->master_ = nullptr;
    waiter->finish();
  }
  schedule();
}

}  // namespace berth::co
