"""The live page of `sainet play`: drag disks, compare predictions, push, plan."""
