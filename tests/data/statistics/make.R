# Restricted means, their standard errors and log-rank tests of the samples beside this file, by R's survival package:
# Rscript make.R > r.tsv
library(survival)
number <- function(x) sprintf("%.17g", x)
cat("# ", R.version.string, ", survival ", as.character(packageVersion("survival")), "\n", sep = "")
cat("set\tgroup\tmean\terror\tstatistic\n")
for (name in c("leukaemia", "ties", "heavy", "uncensored", "thousand")) {
  all <- read.csv(paste0(name, ".csv"))
  for (group in c("all", sort(unique(all$group)))) {
    rows <- if (group == "all") all else all[all$group == group, ]
    fit <- survfit(Surv(time, happened) ~ 1, data = rows, timefix = FALSE)
    table <- summary(fit, rmean = max(rows$time))$table
    statistic <- ""
    if (group == "all") {
      statistic <- number(survdiff(Surv(time, happened) ~ group, data = all)$chisq)
    }
    cat(name, group, number(table["rmean"]), number(table["se(rmean)"]), statistic, sep = "\t")
    cat("\n")
  }
}
