#pragma once

namespace geoflow::daemon::service {

/// Where stderr is the journal, sends the log's lines to it with fields (sd_journal_send(3)):
/// MESSAGE, PRIORITY, SYSLOG_IDENTIFIER, GEOFLOW_CATEGORY, and a line's own. What the journal does
/// not take goes to stderr. To be called once, before any thread starts.
void log_to_journal();

}  // namespace geoflow::daemon::service
